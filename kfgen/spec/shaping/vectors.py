"""Entries that declare vectors -> one entry for each part: the declared shape, and keys spread over the parts."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

from kfgen.spec.constants import NotConstant, value
from kfgen.spec.operations import NoValue, Value
from kfgen.spec.problems import short
from kfgen.spec.raw import Fields, Path
from kfgen.spec.shaping.extents import MOST_PARTS, NUMBER, ROTATION, Extent, Shaped, matrix, suffixes, vector
from kfgen.spec.shaping.formulas import FormulaReader, Local
from kfgen.spec.tree import Expression, Name
from kfgen.spec.types import Group, Matrix

_PART = re.compile(r"[A-Za-z0-9_]+\Z", re.ASCII)
_FORMULAS = ("std", "var", "density", "root_density")
_PAIRS = ("range", "bounds")


@dataclass(frozen=True)
class RawRotation:
    """A quaternion: its four parts, the three of its error, and an entry with std or var for each of these."""

    name: str
    parts: tuple[str, ...]
    errors: tuple[str, str, str]
    fields: Fields
    entries: list[Fields]
    block: Matrix | None


@dataclass
class Declared:
    """What a name was declared as: its entries part by part, and their names."""

    name: str
    extent: Extent
    names: tuple[str, ...]
    entries: list[Fields]
    rotation: RawRotation | None = None
    block: Matrix | None = None  # the covariance of a vector, where `var` (or a density) is a matrix


class VectorReader:
    """Reads declarations. environment: values of constants, for the sizes of vectors."""

    def __init__(self, reader: FormulaReader, environment: dict[str, Value]) -> None:
        self.reader, self.environment = reader, environment
        self.problems, self.walker = reader.problems, reader.walker

    # --- what is declared

    def extent(self, name: str, f: Fields) -> tuple[Extent, tuple[str, ...]]:
        """The shape that an entry declares, and the names of its parts."""
        written = f.get("vector")
        if f.get("kind") == "quaternion":
            if "vector" in f:
                self.problems.add(f.at("vector"), "a quaternion has its own parts: w, x, y, z", "remove `vector`")
            return ROTATION, ()
        if isinstance(written, tuple):
            return self._named(name, f, written)
        if isinstance(written, Expression):
            size = self._size(written)
            return (vector(size), ()) if size is not None else (NUMBER, ())
        return NUMBER, ()

    def _size(self, written: Expression) -> int | None:
        try:
            found = value(self.reader.number(written).tree, self.environment)
        except (NotConstant, NoValue):
            return None
        whole = found == int(found)
        return int(found) if whole and 1 <= found <= MOST_PARTS else None  # else a rule says so

    def _named(self, name: str, f: Fields, written: tuple[Any, ...]) -> tuple[Extent, tuple[str, ...]]:
        parts = tuple(part for part in written if part is not None)
        place = self.walker.value_place(f"{f.place.path}.vector", f.place)
        if not written:
            self.problems.add(place, "a vector without parts", "write `vector: 3`, or the names of its parts")
            return NUMBER, ()
        if len(parts) < len(written):
            return NUMBER, ()
        wrong = next((part for part in parts if not _PART.match(part)), None)
        double = next((part for i, part in enumerate(parts) if part in parts[:i]), None)
        if wrong is not None:
            text = f"the name {short(wrong)} of a part is not made of letters, digits and underscores"
            self.problems.add(place, text, "write `vector: [n, e, d]`")
        elif double is not None:
            self.problems.add(place, f"the part {short(double)} of {short(name)} stands twice", "name each once")
        elif len(parts) > MOST_PARTS:
            self.problems.add(place, f"a vector has at most {MOST_PARTS} parts, not {len(parts)}", "split it")
        else:
            return vector(len(parts)), parts
        return NUMBER, ()

    def names(self, name: str, extent: Extent, own: tuple[str, ...] = ()) -> tuple[str, ...]:
        return (name,) if extent == NUMBER else tuple(f"{name}_{s}" for s in own or suffixes(extent))

    def declare(self, kind: str, name: str, declared: tuple[str, ...], f: Fields, path: Path) -> None:
        """Further names of the name space: the parts of what stands at a path."""
        for part in declared:
            if part != name:
                self.reader.symbols.taken.add(part.upper())
                self.walker.declared.append((kind, part, f.place, path))

    def shaped(self, extent: Extent, names: tuple[str, ...], own: tuple[str, ...]) -> Shaped:
        return Shaped(extent, tuple(map(Name, names)), own)

    # --- entries, part by part

    def parts_of(self, what: str, name: str, names: tuple[str, ...], extent: Extent) -> tuple[str, str]:
        """A message and a cure for a value of the wrong shape."""
        if extent == NUMBER:
            return f"{what} of {short(name)} is a number", "declare `vector: 3` for a vector, or write one number"
        listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        return f"{what} of {short(name)} is {extent}", f"write a list: {listed}; or one number for all"

    def spread(
        self, name: str, f: Fields, extent: Extent, names: tuple[str, ...], formulas: tuple[str, ...],
        local: Local | None = None,
    ) -> Declared:  # fmt: skip
        """The entry of each part. formulas: keys beside variances and ranges that have a value for each part."""
        found = Declared(name, extent, names, [])
        columns: dict[str, tuple[Any, ...]] = {}
        for key, raw in f.values.items():
            if key in (*formulas, *_FORMULAS) and raw is not None:
                columns[key] = self._formula(found, key, raw, local)
            elif key in _PAIRS and isinstance(raw, tuple):
                columns[key] = self._pair(found, key, raw)
            elif key != "vector":
                plain = self.reader.plain(raw, local)
                columns[key] = (plain,) * len(names)
        for i in range(len(names)):
            values = {key: column[i] for key, column in columns.items()}
            found.entries.append(replace(f, values=values))
        return found

    def _formula(self, found: Declared, key: str, raw: Any, local: Local | None) -> tuple[Any, ...]:
        extent = found.extent
        what, hint = self.parts_of(f"`{key}`", found.name, found.names, extent)
        value = self.reader.value(raw, local)
        n = len(found.names)
        if key in ("var", "density") and value.extent == matrix(n, n) and extent.kind == "vector" and not value.bad:
            found.block = tuple(value.parts[i * n : (i + 1) * n] for i in range(n))
            return tuple(value.parts[i * n + i] for i in range(n))
        if value.extent.kind == "matrix" and key in ("std", "root_density"):
            hint = f"a full covariance is written as `{'var' if key == 'std' else 'density'}`"
        return self.reader.fit(value, raw.place, extent, what, hint)

    def _pair(self, found: Declared, key: str, raw: tuple[Any, ...]) -> tuple[Any, ...]:
        if any(end is None for end in raw):
            return (None,) * len(found.names)
        what, hint = self.parts_of(f"the end of `{key}`", found.name, found.names, found.extent)
        ends = [self.reader.parts(end, found.extent, what, hint) for end in raw]
        return tuple(zip(*ends, strict=True))

    # --- quaternions

    def rotation(self, name: str, f: Fields) -> RawRotation:
        """A quaternion among states or components; its std or var are of the rotation error, in rad."""
        errors = errors_of(name)
        own = replace(f, values={key: f.values[key] for key in ("std", "var") if key in f})
        spread = self.spread(name, own, vector(3), errors, ())
        return RawRotation(name, self.names(name, ROTATION), errors, f, spread.entries, spread.block)


def errors_of(name: str) -> tuple[str, str, str]:
    return f"{name}_rx", f"{name}_ry", f"{name}_rz"


def group(name: str, names: tuple[str, ...], f: Fields) -> Group:
    return Group(name, names, f.place)
