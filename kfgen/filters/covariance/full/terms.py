"""A full covariance as it stands in an array, less the terms of measurements that have not been taken from it yet."""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.filters.covariance.looped import Space
from kfgen.filters.frame.triangles import upper, upper_start
from kfgen.ir.trace import Array, Value


@dataclass(frozen=True)
class Term:
    """- weight c c^T of a measurement, c in a local array.

    state: the one that it measures, if it is a single one: row and column of P are then share c, which is what is
    left without the difference of nearly equal numbers.
    """

    c: Array
    weight: Value
    state: int | None = None
    share: Value | None = None


@dataclass(frozen=True)
class Entries:
    """P0 less the terms. P0 is that of the struct, or a local array: packed, or square."""

    space: Space
    array: str = ""  # empty: the struct's
    square: bool = False
    terms: tuple[Term, ...] = ()

    def at(self, n: int, i: int | Value, j: int | Value) -> Value:
        """Entry i <= j of P0."""
        t = self.space.t
        if self.square:
            return Array(t, self.array)[j * n + i]
        return self.at_place(upper_start(j) + i if isinstance(j, Value) else upper(0, j) + i)

    def at_place(self, place: int | Value) -> Value:
        """An entry of a packed P0."""
        t = self.space.t
        return Array(t, self.array)[place] if self.array else t.element("kf.P", place)

    def start(self, *states: int) -> int:
        """The last term that tells the row of one of some states afresh; -1: none."""
        return max((k for k, term in enumerate(self.terms) if term.state in states), default=-1)
