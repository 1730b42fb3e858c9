"""Keys that name states: whole vectors, their parts, or the errors of quaternions; with a value for each."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from kfgen.errors import Place
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD, Fields, Listed, Word, entries
from kfgen.spec.shaping.extents import NUMBER, ROTATION, Extent, matrix, vector
from kfgen.spec.shaping.formulas import FormulaReader, Local
from kfgen.spec.tree import Expression, Number
from kfgen.spec.types import Definition


@dataclass
class States:
    """What a key may name: name -> its parts; of a quaternion the four, and its errors beside."""

    parts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    errors: dict[str, tuple[str, str, str]] = field(default_factory=dict)  # quaternion -> names of its error
    scalars: list[str] = field(default_factory=list)  # all parts, in order

    @property
    def coordinates(self) -> list[str]:
        """The error's coordinates, in order."""
        found: list[str] = []
        first = {self.parts[q][0]: e for q, e in self.errors.items()}
        others = {p for q in self.errors for p in self.parts[q][1:]}
        for name in self.scalars:
            if name not in others:
                found += first.get(name, (name,))
        return found

    def of(self, name: str, errors: bool) -> tuple[str, ...] | None:
        """The parts that a name stands for; None where there is none."""
        if errors and name in self.errors:
            return self.errors[name]
        if name in self.parts:
            return self.parts[name]
        known = self.coordinates if errors else self.scalars
        return (name,) if name in known else None

    def extent(self, name: str, errors: bool) -> Extent:
        if name in self.errors:
            return vector(3) if errors else ROTATION
        return vector(len(self.parts[name])) if name in self.parts else NUMBER

    def quaternion_of(self, part: str) -> str | None:
        """The quaternion of which a name is a part, or an error."""
        found = (q for q in self.errors if part in self.parts[q] or part in self.errors[q])
        return next(found, None)


class TargetReader:
    """Spreads what is keyed by states over parts."""

    def __init__(self, reader: FormulaReader, states: States) -> None:
        self.reader, self.states = reader, states
        self.problems = reader.problems

    def table(
        self, written: Fields, errors: bool, key: str, whole: bool = False, local: Local | None = None,
        own: list[Definition] | None = None,
    ) -> tuple[Fields, dict[str, tuple[tuple[Expression, ...], ...]]]:  # fmt: skip
        """By part; and the blocks of vectors that were written as matrices, by their first part.

        errors: a quaternion has its three errors here; whole: it may not be named by its parts.
        """
        found = replace(written, values={}, places={})
        blocks: dict[str, tuple[tuple[Expression, ...], ...]] = {}
        for name, raw in written.values.items():
            place = written.at(name)
            targets = self.targets(name, place, errors, whole)
            if targets is None:
                value = None if raw is None else self.reader.value(raw, local, own).parts[0]
                found.values[name], found.places[name] = value, place
                continue
            values = self.values(name, raw, targets, errors, key, blocks, local, own)
            for target, value in zip(targets, values, strict=True):
                if target in found.values:
                    text = f"{short(target)} is given here, and by another name too"
                    self.problems.add(place, text, "write a vector whole, or each part once")
                found.values[target], found.places[target] = value, place
        return found, blocks

    def targets(self, name: str, place: Place, errors: bool, whole: bool = False) -> tuple[str, ...] | None:
        """The parts that a key names; None where it names none, which is said where references are checked."""
        quaternion = self.states.quaternion_of(name)
        if quaternion is not None and (whole or name not in (self.states.errors if errors else self.states.parts)):
            listed = self.states.errors[quaternion] if errors else self.states.parts[quaternion]
            if whole or name not in listed:
                what = "no coordinate of an error" if errors else "no state"
                text = f"{short(name)} belongs to the quaternion {short(quaternion)} and is {what} of its own here"
                cure = f"name it whole, `{quaternion}`" + ("" if whole else ", or " + ", ".join(listed))
                self.problems.add(place, text, cure)
                self.reader.walker.doubtful.add(name)
                return None
        return self.states.of(name, errors)

    def values(
        self, name: str, raw: Any, targets: tuple[str, ...], errors: bool, key: str, blocks: dict[str, Any],
        local: Local | None, own: list[Definition] | None,
    ) -> tuple[Any, ...]:  # fmt: skip
        if raw is None:
            return (None,) * len(targets)
        extent = self.states.extent(name, errors)
        n, spread = len(targets), True
        value = self.reader.value(raw, local, own)
        square = key in ("Q",) and value.extent == matrix(n, n) and extent != NUMBER and not value.bad
        if square:
            blocks[targets[0]] = tuple(value.parts[i * n : (i + 1) * n] for i in range(n))
            return tuple(value.parts[i * n + i] for i in range(n))
        what = f"{short(name)} is {extent}" if key == "states" else f"`{key}` of {short(name)} is {extent}"
        listed = ", ".join(targets[:8])
        hint = "write one number" if extent == NUMBER else f"write a list: {listed}"
        if key == "f" and name in self.states.errors:
            hint = "write the new quaternion, such as `q*from_rotation_vector(rate*dt)`"
            if errors:
                hint = "write the body's angular rate, a 3-vector in rad/s"
            spread = False
        elif extent == ROTATION and key == "states":
            hint = "write a quaternion, such as `triad(a, b, ra, rb)` or `rotation_between(a, b)`"
            spread = False
        if name in self.reader.symbols.unsure:
            value.unknown = True
        return self.reader.fit(value, raw.place, extent, what, hint, spread)

    def words(self, words: Any, errors: bool) -> tuple[Any, ...]:
        """A list of states, each whole or a part."""
        found: list[Any] = []
        for word in words or ():
            if not isinstance(word, Word):
                continue
            targets = self.targets(word.text, word.place, errors)
            found += [Word(target, word.place) for target in targets] if targets is not None else [word]
        return tuple(found)

    def covariances(self, triples: Any) -> tuple[Any, ...]:
        """[a, b, c]: of two vectors a matrix, or, of the same size, numbers part by part."""
        found: list[Any] = []
        for triple in triples or ():
            if triple is None or not (isinstance(triple[0], Word) and isinstance(triple[1], Word)):
                found.append(None if triple is None else (*triple[:2], self.reader.plain(triple[2])))
                continue
            first, second = (self.targets(w.text, w.place, True) for w in triple[:2])
            if first is None or second is None or (len(first) == len(second) == 1):
                found.append((*triple[:2], self.reader.plain(triple[2])))
                continue
            found += self._block(triple, first, second)
        return tuple(found)

    def _block(self, triple: Any, first: tuple[str, ...], second: tuple[str, ...]) -> list[Any]:
        a, b, raw = triple
        value = self.reader.value(raw)
        rows, columns = len(first), len(second)
        pairs = [(i, j) for i in range(rows) for j in range(columns)]
        if rows == columns and value.extent in (NUMBER, vector(rows)):
            pairs = [(i, i) for i in range(rows)]
            extent = vector(rows)
        else:
            extent = matrix(rows, columns) if rows > 1 and columns > 1 else vector(max(rows, columns))
        what = f"the covariance of {short(a.text)} and {short(b.text)} is {extent}"
        parts = self.reader.fit(value, raw.place, extent, what, "write rows of numbers", rows == columns)
        return [
            (Word(first[i], a.place), Word(second[j], b.place), part)
            for (i, j), part in zip(pairs, parts, strict=True)
        ]


def full(table: Fields, blocks: dict[str, Any], names: list[str], place: Place) -> tuple[Any, ...]:
    """The whole matrix of a diagonal with blocks."""
    zero = Expression(Number(Fraction(0)), "0", place)
    index = {name: i for i, name in enumerate(names)}
    rows = [[zero] * len(names) for _ in names]
    for name, value in entries(table):
        if name in index:
            rows[index[name]][index[name]] = value
    for first, block in blocks.items():
        for i, row in enumerate(block):
            for j, value in enumerate(row):
                rows[index[first] + i][index[first] + j] = value
    return tuple(map(tuple, rows))


def rows_of(reader: FormulaReader, written: Any, local: Local | None = None) -> Any:
    """A matrix: rows as the walker has them, or an expression; None where its mistake has been reported."""
    if written is None:
        return None
    if isinstance(written, Expression | Listed):
        value = reader.value(written, local)
        if value.bad:
            return None
        if value.extent.kind != "matrix":
            if not value.unknown:
                reader.problems.add(written.place, f"a matrix is wanted here, not {value.extent}",
                                    "write a list of rows, or `diag([...])`")  # fmt: skip
            return None
        columns = value.extent.columns
        return tuple(value.parts[i * columns : (i + 1) * columns] for i in range(value.extent.rows))
    return tuple(None if row is None else _row(reader, row, local) for row in written)


def _row(reader: FormulaReader, row: Any, local: Local | None) -> Any:
    """A row: numbers, or one expression that is a vector."""
    if not isinstance(row, Expression | Listed):
        return reader.plain(row, local)
    value = reader.value(row, local)
    if value.extent.kind != "vector" and not value.bad and not value.unknown:
        reader.problems.add(row.place, f"a row of numbers is wanted here, not {value.extent}", "write a list")
        return None
    return None if value.bad else value.parts


__all__ = ["BAD", "States", "TargetReader", "full", "rows_of"]
