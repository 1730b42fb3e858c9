"""Loops of algorithms that serve straight-line code and looped code alike: written out, or kept in the program.

An algorithm says `for j in sweep.each("j", 0, n)`; with `Unrolled` j runs through the integers, with `InLoops` it is
the counter of one loop that is recorded. What is carried from one turn to the next stands in cells and vectors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from kfgen.filters.algebra.linalg import Rows
from kfgen.filters.algebra.numbers import Number
from kfgen.filters.algebra.triangles import strict_start, upper_start
from kfgen.ir.trace import Trace, Value

Index = Any  # an int, or a loop's counter


class Cell(Protocol):
    """A number that changes from turn to turn."""

    def get(self) -> Number: ...

    def set(self, value: Number) -> None: ...


class Sweep(Protocol):
    """How loops become code."""

    def each(self, name: str, start: Index, stop: Index, down: bool = False) -> Iterator[Index]:
        """start .. stop - 1, or downwards."""
        ...

    def cell(self, name: str, value: Number) -> Cell: ...

    def vector(self, name: str, n: int) -> Any:
        """n numbers, 0 or not yet set, by index."""
        ...

    def name(self, value: Number, name: str) -> Number:
        """The value, under a name where loops need to be read."""
        ...


@dataclass
class Box:
    """A cell of straight-line code."""

    value: Number

    def get(self) -> Number:
        return self.value

    def set(self, value: Number) -> None:
        self.value = value


class Unrolled:
    """Every turn by itself: what is zero by structure costs nothing."""

    def each(self, name: str, start: int, stop: int, down: bool = False) -> Iterator[int]:
        return iter(range(stop - 1, start - 1, -1) if down else range(start, stop))

    def cell(self, name: str, value: Number) -> Box:
        return Box(value)

    def vector(self, name: str, n: int) -> list[Number]:
        return [0] * n

    def name(self, value: Number, name: str) -> Number:
        return value


class InLoops:
    """One loop of the traced program each."""

    def __init__(self, t: Trace) -> None:
        self.t = t

    def each(self, name: str, start: Index, stop: Index, down: bool = False) -> Iterator[Value]:
        with self.t.loop(name, start, stop, down) as counter:
            yield counter

    def cell(self, name: str, value: Number) -> Cell:
        return self.t.variable(name, value)

    def vector(self, name: str, n: int) -> Any:
        return self.t.array(name, n)

    def name(self, value: Number, name: str) -> Number:
        return self.t.name(self.t.value(value), name)


class Matrix:
    """Entries by row and column, of rows."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    def __getitem__(self, place: tuple[int, int]) -> Number:
        return self.rows[place[0]][place[1]]

    def __setitem__(self, place: tuple[int, int], value: Number) -> None:
        self.rows[place[0]][place[1]] = value


class PackedStrict:
    """Entries above the diagonal, of an array that holds them column by column."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __getitem__(self, place: tuple[Value, Value]) -> Value:
        value: Value = self.array[strict_start(place[1]) + place[0]]
        return value

    def __setitem__(self, place: tuple[Value, Value], value: Number) -> None:
        self.array[strict_start(place[1]) + place[0]] = value


class PackedUpper:
    """Entries on and above the diagonal, of an array that holds them column by column."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __getitem__(self, place: tuple[Value, Value]) -> Value:
        value: Value = self.array[upper_start(place[1]) + place[0]]
        return value

    def __setitem__(self, place: tuple[Value, Value], value: Number) -> None:
        self.array[upper_start(place[1]) + place[0]] = value
