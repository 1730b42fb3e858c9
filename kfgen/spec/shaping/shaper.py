"""The raw data of a spec with vectors -> raw data of numbers: every vector is its parts from here on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from kfgen.spec.constants import keep
from kfgen.spec.operations import Value
from kfgen.spec.problems import short
from kfgen.spec.raw import Fields, Path, entries
from kfgen.spec.shaping.definitions import Definitions
from kfgen.spec.shaping.extents import NUMBER, ROTATION, Shaped
from kfgen.spec.shaping.formulas import FormulaReader
from kfgen.spec.shaping.modeling import ModelShaper
from kfgen.spec.shaping.sensors import SensorShaper
from kfgen.spec.shaping.starting import StartShaper
from kfgen.spec.shaping.symbols import Symbols
from kfgen.spec.shaping.targets import States, TargetReader
from kfgen.spec.shaping.vectors import VectorReader, group
from kfgen.spec.types import Definition, Group
from kfgen.spec.walk import Walker

_IN_ORDER = ("constants", "parameters", "dt", "states", "inputs", "noise")


class Shaper:
    """Flattens one spec. After `flat` it knows the groups and the definitions that no user has written."""

    def __init__(self, walker: Walker, top: Fields) -> None:
        self.walker, self.top = walker, top
        self.problems = walker.problems
        self.symbols = Symbols(name for _, name, _, _ in walker.declared)
        self.reader = FormulaReader(walker, self.symbols)
        self.environment: dict[str, Value] = {}
        self.vectors = VectorReader(self.reader, self.environment)
        self.states = States()
        self.targets = TargetReader(self.reader, self.states)
        self.groups: dict[str, Group] = {}
        self.definitions = Definitions(self.reader, self.vectors)
        self.sensors = SensorShaper(self.reader, self.vectors)
        self.model = ModelShaper(self.reader, self.vectors, self.targets)
        self.starts = StartShaper(self.reader, self.targets)

    def flat(self) -> Fields:
        top, flat = self.top, replace(self.top, values={})
        for key in _IN_ORDER:
            if key in top.values:
                flat.values[key] = self._declaring(key, top.values[key])
        modes = dict(entries(imm.get("modes"))) if isinstance(imm := top.get("imm"), Fields) else {}
        for mode in modes.values():
            self._mode_noise(mode)
        lets: list[tuple[Path, Any]] = [(("let",), top.get("let"))]
        lets += [(("imm", "modes", name, "let"), mode.get("let")) for name, mode in modes.items()]
        self._lets([(path, let) for path, let in lets if isinstance(let, Fields)])
        for key, raw in top.values.items():
            if key not in (*_IN_ORDER, "initialize"):
                flat.values[key] = self._section(key, raw, ())
        if "initialize" in top:
            flat.values["initialize"] = self.starts.initialize(top.get("initialize"), self.sensors.components)
        self._blocks(flat)
        self._unfinished()
        self.reader.finish()
        return flat

    # --- what declares names

    def _declaring(self, key: str, raw: Any) -> Any:
        if not isinstance(raw, Fields) or key == "dt":
            return self.reader.plain(raw)
        if key == "constants":
            return self._constants(raw)
        kind = {"parameters": "parameter", "states": "state", "inputs": "input", "noise": "noise"}[key]
        return self._table(kind, raw, (key,))

    def _constants(self, raw: Fields) -> Fields:
        found = replace(raw, values={}, places={})
        for name, written in raw.values.items():
            if written is None:
                continue
            value = self.reader.value(written)
            names = self.vectors.names(name, value.extent)
            if not (value.bad or value.unknown) or value.extent == NUMBER:
                self._know(name, "constant", value.extent, names, (), found, raw)
            for part, expression in zip(names, value.parts, strict=True):
                found.values[part], found.places[part] = expression, raw.at(name)
                keep(self.environment, part, expression.tree)
        return found

    def _know(
        self, name: str, kind: str, extent: Any, names: tuple[str, ...], own: tuple[str, ...], f: Fields, raw: Fields
    ) -> None:
        """A name of the spec from here on."""
        self.symbols.known[name] = self.vectors.shaped(extent, names, own)
        if extent == NUMBER:
            return
        self.groups[name] = Group(name, names, raw.at(name))
        for part in names:
            self.symbols.known[part] = Shaped(NUMBER, self.symbols.known[name].parts[names.index(part) :][:1])
            self.walker.declared.append((kind, part, raw.at(name), (*raw.path, name)))
            self.symbols.taken.add(part.upper())

    def _table(self, kind: str, raw: Fields, path: Path) -> Fields:
        """states, inputs, parameters, noise: entries that may be vectors."""
        found = replace(raw, values={}, places={})
        rotations, blocks = [], {}
        for name, f in raw.values.items():
            if not isinstance(f, Fields):
                continue
            extent, own = self.vectors.extent(name, f)
            if kind == "parameter" and "vector" not in f and f.get("value") is not None:
                extent = self.reader.value(f.get("value")).extent
            names = self.vectors.names(name, extent, own)
            self._know(name, kind, extent, names, own, f, raw)
            formulas = {"state": ("init",), "parameter": ("value",)}.get(kind, ())
            plain = f
            if extent == ROTATION:
                rotation = self.vectors.rotation(name, f)
                rotations.append(rotation)
                plain = replace(f, values={k: v for k, v in f.values.items() if k not in ("std", "var")})
                self.states.errors[name] = rotation.errors
                for part in rotation.errors:
                    self.walker.declared.append(("rotation error", part, raw.at(name), (*raw.path, name)))
                if rotation.block is not None:
                    blocks[rotation.errors[0]] = rotation.block
            made = self.vectors.spread(name, plain, extent, names, formulas)
            if made.block is not None:
                blocks[names[0]] = made.block
            if kind == "state":
                self.states.scalars += names
                if extent != NUMBER:
                    self.states.parts[name] = names
            for part, entry in zip(names, made.entries, strict=True):
                found.values[part], found.places[part] = entry, raw.at(name)
        if kind in ("state", "noise"):
            self.model.blocks[path] = blocks
        if kind == "state":
            self.model.rotations[path] = rotations
        return found

    def _mode_noise(self, mode: Fields) -> None:
        noise = mode.get("noise")
        if isinstance(noise, Fields):
            before = dict(self.symbols.known)
            mode.values["noise"] = self._table("noise", noise, noise.path)
            self._differing(before, noise)

    def _differing(self, before: dict[str, Shaped], table: Fields) -> None:
        """A name means one shape in all modes, which share formulas."""
        for name in table.values:
            old, new = before.get(name), self.symbols.known.get(name)
            if old is not None and new is not None and old.extent != new.extent:
                text = f"{short(name)} is {new.extent} here, and {old.extent} elsewhere"
                self.problems.add(table.at(name), text, "give it one shape in all modes, or another name")

    def _lets(self, lets: list[tuple[Path, Fields]]) -> None:
        self.definitions.collect(lets)
        for path, let in lets:
            before = dict(self.symbols.known)
            for name, extent, names in self.definitions.shapes(path):
                self._know(name, "definition", extent, names, (), let, let)
            self._differing(before, let)

    # --- what uses them

    def _section(self, key: str, raw: Any, mode: Path) -> Any:
        path = (*mode, key)
        if key == "let":
            return self.definitions.flat(path) if isinstance(raw, Fields) else raw
        if key == "measurements":
            return self.sensors.sensors(raw, mode)
        if key == "imm" and isinstance(raw, Fields):
            return self._imm(raw)
        if key == "outputs":
            return self.model.outputs(raw)
        if key == "noise":  # of a mode: done already
            return raw
        return self.model.section(key, raw, path)

    def _imm(self, raw: Fields) -> Fields:
        found = replace(raw, values={})
        for key, written in raw.values.items():
            if key != "modes" or not isinstance(written, Fields):
                found.values[key] = self.model.bank(key, written)
                continue
            modes = replace(written, values={})
            for name, mode in written.values.items():
                modes.values[name] = self._mode(name, mode) if isinstance(mode, Fields) else mode
            found.values[key] = modes
        return found

    def _mode(self, name: str, raw: Fields) -> Fields:
        path = ("imm", "modes", name)
        flat = replace(raw, values={key: self._section(key, value, path) for key, value in raw.values.items()})
        self._blocks(flat, path)
        return flat

    def _blocks(self, flat: Fields, path: Path = ()) -> None:
        """Variances written as matrices, as covariances beside the others."""
        self.model.state_blocks(flat, path)
        self.model.noise_blocks(flat, path)

    def _unfinished(self) -> None:
        """Formulas in sections that could not be read are still judged, as numbers."""
        for w in self.walker.formulas:
            if w.expression.place not in self.reader.finished and w.scope != "initialize":
                self.reader.value(w.expression)

    # --- results

    def hidden(self, contexts: Iterable[Path]) -> tuple[Definition, ...]:
        """The definitions that no user has written, of some sections."""
        return tuple(d for path in contexts for d in self.symbols.hidden.get(path, ()))


__all__ = ["Shaper", "group"]
