"""Sensors whose components, inputs and noises are vectors -> sensors of numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kfgen.spec.problems import short
from kfgen.spec.raw import BAD, Fields, Path
from kfgen.spec.shaping.extents import NUMBER, ROTATION, Extent, Shaped
from kfgen.spec.shaping.formulas import FormulaReader
from kfgen.spec.shaping.targets import rows_of
from kfgen.spec.shaping.vectors import Declared, RawRotation, VectorReader
from kfgen.spec.tree import Call, Expression, Name, Tree
from kfgen.spec.types import Group, Matrix

Local = dict[str, Shaped]


class SensorShaper:
    def __init__(self, reader: FormulaReader, vectors: VectorReader) -> None:
        self.reader, self.vectors = reader, vectors
        self.problems, self.walker = reader.problems, reader.walker
        self.components: dict[str, Local] = {}  # sensor -> what `initialize` may name

    def sensors(self, raw: Any, mode: Path) -> Any:
        if not isinstance(raw, Fields):
            return raw
        flat = replace(raw, values={})
        for name, f in raw.values.items():
            flat.values[name] = self._sensor(name, f) if isinstance(f, Fields) else f
        return flat

    def _sensor(self, name: str, raw: Fields) -> Fields:
        flat = replace(raw, values={})
        local: Local = {}
        groups: list[Group] = []
        blocks: dict[str, Matrix] = {}
        inputs = self._declared(raw.get("inputs"), local, groups, blocks)
        named = dict(local)  # of these `initialize` knows
        noise_blocks: dict[str, Matrix] = {}
        noise = self._declared(raw.get("noise"), local, groups, noise_blocks)
        components, rotations = self._components(raw.get("z"), local, groups, blocks, named)
        self._twice(components, inputs, raw)
        for key, value in raw.values.items():
            if key in ("R", "noise_covariance"):
                flat.values[key] = rows_of(self.reader, value, local)
            elif key in ("z", "inputs", "noise") and isinstance(value, Fields):
                flat.values[key] = {"z": components, "inputs": inputs, "noise": noise}[key]
            else:
                flat.values[key] = self.reader.plain(value, local)
        extra = {"groups": tuple(groups), "rotations": rotations, "blocks": blocks, "noise blocks": noise_blocks}
        flat.values |= {key: value for key, value in extra.items() if value}
        self.components.setdefault(name, named)
        return flat

    def _twice(self, components: Any, inputs: Any, raw: Fields) -> None:
        """Components and inputs are fields of one struct."""
        for name in components.values if isinstance(components, Fields) else ():
            if isinstance(inputs, Fields) and name in inputs.values:
                text = f"the input {short(name)} has the name of a component: both are fields of {short(raw.path[-1])}"
                self.problems.add(inputs.at(name), text, "choose another name")

    def _declared(self, raw: Any, local: Local, groups: list[Group], blocks: dict[str, Matrix]) -> Any:
        """inputs, noise."""
        if not isinstance(raw, Fields):
            return raw
        flat = replace(raw, values={}, places={})
        kind = "input" if raw.path[-1] == "inputs" else "noise"
        for name, f in raw.values.items():
            if not isinstance(f, Fields):
                continue
            extent, own = self.vectors.extent(name, f)
            names = self.vectors.names(name, extent, own)
            made = self.vectors.spread(name, f, extent, names, (), local)
            self._know(local, name, extent, names, own)
            self.vectors.declare(kind, name, names, f, (*raw.path, name))
            self._put(flat, made, raw, groups, blocks)
        return flat

    def _put(self, flat: Fields, made: Declared, raw: Fields, groups: list[Group], blocks: dict[str, Matrix]) -> None:
        if made.extent != NUMBER:
            groups.append(Group(made.name, made.names, raw.at(made.name)))
        if made.block is not None:
            blocks[made.names[0]] = made.block
        for part, entry in zip(made.names, made.entries, strict=True):
            if part in flat.values:
                text = f"{short(part)} is there twice: as a part of a vector, and by itself"
                self.problems.add(raw.at(made.name), text, "choose another name")
            flat.values[part], flat.places[part] = entry, raw.at(made.name)

    def _know(self, local: Local, name: str, extent: Extent, names: tuple[str, ...], own: tuple[str, ...] = ()) -> None:
        whole = self.vectors.shaped(extent, names, own)
        for part in names:
            local[part] = Shaped(NUMBER, (Name(part),))
        local[name] = whole

    # --- components

    def _components(
        self, raw: Any, local: Local, groups: list[Group], blocks: dict[str, Matrix], named: Local
    ) -> tuple[Any, list[RawRotation]]:
        rotations: list[RawRotation] = []
        if not isinstance(raw, Fields):
            return raw, rotations
        flat = replace(raw, values={}, places={})
        for name, f in raw.values.items():
            if not isinstance(f, Fields):
                continue
            extent, names, own = self._measured(name, f, local)
            plain = f
            if extent == ROTATION:
                plain = self._quaternion(name, f, rotations, blocks)
            elif "error" in f:
                self.problems.add(f.at("error"), f"{short(name)} is no quaternion, and has no `error`", "remove it")
            residual = plain.values.get("residual")
            bare = replace(plain, values={k: v for k, v in plain.values.items() if k not in ("residual", "error")})
            made = self.vectors.spread(name, bare, extent, names, ("h",), local)
            if residual is not None:
                for i, part in enumerate(self._residual(residual, extent, local)):
                    made.entries[i].values["residual"] = part
            self._know(named, name, extent, names, own)
            self.vectors.declare("component", name, names, f, (*raw.path, name))
            self._put(flat, made, raw, groups, blocks)
        return flat, rotations

    def _measured(self, name: str, f: Fields, local: Local) -> tuple[Extent, tuple[str, ...], tuple[str, ...]]:
        """The shape of h, and the names of the components that it makes."""
        raw = f.get("h")
        if raw is None:
            return NUMBER, (name,), ()
        value = self.reader.value(raw, local)
        extent = NUMBER if value.bad else value.extent
        own = value.suffixes
        if extent.kind == "matrix":
            self.problems.add(raw.place, f"h of {short(name)} is {extent}", "write a number, a vector or a quaternion")
            extent = NUMBER
        if f.get("kind") == "quaternion" and extent != ROTATION and not value.bad:
            if extent.kind == "vector" and extent.rows == 4:
                extent, own = ROTATION, ()
            elif not value.unknown:
                text = f"h of {short(name)} is {extent}, but its kind is quaternion"
                self.problems.add(raw.place, text, "write a quaternion, or leave `kind` out")
        return extent, self.vectors.names(name, extent, own), own

    def _quaternion(
        self, name: str, f: Fields, rotations: list[RawRotation], blocks: dict[str, Matrix]
    ) -> Fields:
        if "residual" in f:
            text = f"{short(name)} is a quaternion: its residual is a rotation"
            self.problems.add(f.at("residual"), text, "remove `residual`")
        if f.get("kind", "quaternion") not in ("quaternion", "real"):
            text = f"h of {short(name)} is a quaternion, whose residual is a rotation already"
            self.problems.add(f.at("kind"), text, "remove `kind`")
        rotation = self.vectors.rotation(name, f)
        rotations.append(rotation)
        if rotation.block is not None:
            blocks[rotation.errors[0]] = rotation.block
        dropped = ("std", "var", "residual", "error", "kind")
        values = {key: value for key, value in f.values.items() if key not in dropped}
        return replace(f, values={**values, "kind": "quaternion"})

    def _residual(self, raw: Any, extent: Extent, local: Local) -> tuple[Expression, ...]:
        """In z and h; each part in its own."""
        own = {}
        for name in ("z", "h"):
            names = [name if extent == NUMBER else f"{name} {i}" for i in range(extent.size)]
            own[name] = Shaped(extent, tuple(map(Name, names)))
        what, hint = f"the residual is {extent}, as h is", "write for example `z - h`"
        parts = self.reader.parts(raw, extent, what, hint, {**local, **own}, spread=False)
        if extent == NUMBER:
            return parts
        return tuple(self._own(part, i) for i, part in enumerate(parts))

    def _own(self, part: Expression, i: int) -> Expression:
        crossing = False

        def renamed(tree: Tree) -> Tree:
            nonlocal crossing
            if isinstance(tree, Name):
                name, _, index = tree.name.partition(" ")
                crossing = crossing or (index != "" and int(index) != i)
                return Name(name)
            return Call(tree.op, tuple(map(renamed, tree.args))) if isinstance(tree, Call) else tree

        tree = part.tree if part.tree == BAD else renamed(part.tree)
        if crossing:
            text = f"part {i + 1} of the residual uses other parts of z or h than its own"
            self.problems.add(part.place, text, "write a residual that works part by part")
            tree = BAD
        found = replace(part, tree=tree)
        parts = self.reader.finished.get(part.place)
        if parts is not None:
            self.reader.finished[part.place] = tuple(found if each is part else each for each in parts)
        return found
