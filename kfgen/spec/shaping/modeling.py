"""Sections that use vectors: dynamics, covariances, options by state, outputs; of the top and of modes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kfgen.spec.problems import short
from kfgen.spec.raw import Fields, Path, Word, entries
from kfgen.spec.shaping.extents import NUMBER, ROTATION
from kfgen.spec.shaping.formulas import FormulaReader
from kfgen.spec.shaping.targets import TargetReader, full, rows_of
from kfgen.spec.shaping.vectors import RawRotation, VectorReader
from kfgen.spec.types import Matrix


class ModelShaper:
    """Flattens one section at a time."""

    def __init__(self, reader: FormulaReader, vectors: VectorReader, targets: TargetReader) -> None:
        self.reader, self.vectors, self.targets = reader, vectors, targets
        self.problems = reader.problems
        self.blocks: dict[Path, dict[str, Matrix]] = {}  # path of a table -> first part -> covariance of a vector
        self.rotations: dict[Path, list[RawRotation]] = {}

    def section(self, key: str, raw: Any, path: Path) -> Any:
        if raw is None:
            return None
        if key == "covariances":
            return self.targets.covariances(raw)
        if key in ("P0", "noise_covariance"):
            return rows_of(self.reader, raw)
        if not isinstance(raw, Fields):
            return self.reader.plain(raw)
        if key == "states":
            return self.mode_states(raw, path)
        if key == "dynamics":
            return self.dynamics(raw)
        if key == "filter":
            return self.options(raw)
        if key == "fixed":
            return self.by_part(raw, "scale", errors=False)
        if key == "code":
            return self._words(raw, "compensated", errors=False)
        return self.reader.plain(raw)

    def dynamics(self, raw: Fields) -> Fields:
        flat = replace(raw, values=dict(raw.values))
        continuous = raw.get("form", "discrete") == "continuous"
        for key, written in raw.values.items():
            if key == "f" and isinstance(written, Fields):
                flat.values[key], _ = self.targets.table(written, continuous, "f", whole=True)
            elif key == "Q" and isinstance(written, Fields):
                table, blocks = self.targets.table(written, True, "Q")
                place = raw.at("Q")
                coordinates = self.targets.states.coordinates
                flat.values[key] = full(table, blocks, coordinates, place) if blocks else table
            elif key == "Q":
                flat.values[key] = rows_of(self.reader, written)
            else:
                flat.values[key] = self.reader.plain(written)
        return flat

    def options(self, raw: Fields) -> Fields:
        flat = self._words(raw, "consider", errors=True)
        for key in ("variance_floor", "variance_ceiling"):
            flat = self.by_part(flat, key, errors=True)
        return flat

    def by_part(self, raw: Fields, key: str, errors: bool) -> Fields:
        """A table by state, among keys that hold numbers."""
        flat = replace(raw, values=dict(raw.values))
        written = raw.get(key)
        for other, value in raw.values.items():
            if other == key and isinstance(written, Fields):
                flat.values[key], _ = self.targets.table(written, errors, key)
            else:
                flat.values[other] = value if other == key and not errors else self.reader.plain(value)
        return flat

    def _words(self, raw: Fields, key: str, errors: bool) -> Fields:
        flat = replace(raw, values=dict(raw.values))
        words = raw.get(key)
        if isinstance(words, tuple):
            flat.values[key] = self.targets.words(words, errors)
        return flat if errors else self.reader.plain(flat)

    def outputs(self, raw: Any) -> Any:
        """What firmware reads: a vector by its parts."""
        if not isinstance(raw, Fields):
            return raw
        flat = replace(raw, values={}, places={})
        for name, f in raw.values.items():
            if not isinstance(f, Fields):
                continue
            value = None if f.get("value") is None else self.reader.value(f.get("value"))
            extent = NUMBER if value is None or value.bad else value.extent
            own = value.suffixes if value is not None else ()
            names = self.vectors.names(name, extent, own)
            for i, part in enumerate(names):
                values = dict(f.values) if value is None else {**f.values, "value": value.parts[i]}
                if part in flat.values:
                    text = f"the output {short(part)} is there twice: of a vector, and by itself"
                    self.problems.add(f.place, text, "choose another name")
                flat.values[part], flat.places[part] = replace(f, values=values), f.place
            self.vectors.declare("output", name, names, f, raw.path)
        return flat

    def bank(self, key: str, written: Any) -> Any:
        """transition, mu0, mu_floor."""
        return rows_of(self.reader, written) if key == "transition" else self.reader.plain(written)

    # --- states of a mode, and covariances of vectors

    def mode_states(self, raw: Fields, path: Path) -> Fields:
        states = self.targets.states
        flat = replace(raw, values={}, places={})
        rotations, blocks = [], {}
        for name, f in raw.values.items():
            extent, names = states.extent(name, False), states.of(name, False)
            if not isinstance(f, Fields) or names is None:
                flat.values[name], flat.places[name] = self.reader.plain(f), raw.at(name)
                continue
            plain = f
            if extent == ROTATION:
                rotation = self.vectors.rotation(name, f)
                rotations.append(rotation)
                plain = replace(f, values={k: v for k, v in f.values.items() if k not in ("std", "var")})
                if rotation.block is not None:
                    blocks[rotation.errors[0]] = rotation.block
            made = self.vectors.spread(name, plain, extent, names, ("init",))
            if made.block is not None:
                blocks[names[0]] = made.block
            for part, entry in zip(names, made.entries, strict=True):
                flat.values[part], flat.places[part] = entry, raw.at(name)
        self.rotations[path], self.blocks[path] = rotations, blocks
        return flat

    def state_blocks(self, flat: Fields, path: Path) -> None:
        """Covariances within vectors, whose `var` is a matrix."""
        blocks = self.blocks.get((*path, "states"))
        if not blocks or "P0" in flat:
            return
        coordinates = self.targets.states.coordinates
        found = list(flat.get("covariances", ()))
        for first, block in blocks.items():
            at = coordinates.index(first)
            self._symmetric(block)
            for i, row in enumerate(block):
                for j in range(i):
                    words = (Word(coordinates[at + j], row[j].place), Word(coordinates[at + i], row[j].place))
                    found.append((*words, row[j]))
        flat.values["covariances"] = tuple(found)

    def _symmetric(self, block: Matrix) -> None:
        for i, row in enumerate(block):
            for j in range(i):
                if row[j].tree != block[j][i].tree and row[j].text != block[j][i].text:
                    text = f"the matrix is not symmetric: row {j + 1}, column {i + 1} has {short(block[j][i].text)}"
                    self.problems.add(row[j].place, text, "write the same in both")

    def noise_blocks(self, flat: Fields, path: Path) -> None:
        blocks = self.blocks.get((*path, "noise"))
        if blocks:
            flat.values["noise blocks"] = blocks


def tables(written: Any) -> list[tuple[str, Fields]]:
    return [(name, f) for name, f in entries(written) if isinstance(f, Fields)]
