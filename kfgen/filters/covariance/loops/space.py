"""The local arrays of a function that works on a covariance in loops."""

from __future__ import annotations

from dataclasses import dataclass, field

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.frame.runs import put
from kfgen.ir.trace import Array, Trace, Value


@dataclass
class Space:
    """Arrays by name, each declared when it is first asked for."""

    t: Trace
    arrays: dict[str, Array] = field(default_factory=dict)
    pair: str = "w"  # the array of two columns to be absorbed
    h: set[int] = field(default_factory=set)  # where the array of a row of H is not zero

    def array(self, name: str, size: int) -> Array:
        if name not in self.arrays:
            self.arrays[name] = self.t.array(name, size)
        return self.arrays[name]

    def row(self, h: Vector) -> tuple[int, int]:
        """Have the array `h` hold a row; the first and the last of its entries that are not zero."""
        n, t = len(h), self.t
        new = "h" not in self.arrays
        array = self.array("h", n)
        seen = {i for i, x in enumerate(h) if not is_zero(x)}
        if new:
            with t.loop("i", 0, n) as i:
                array[i] = 0
        for place in sorted(self.h - seen):
            array[place] = 0
        for place in sorted(seen):
            array[place] = t.value(h[place])
        self.h = seen
        return min(seen, default=n), max(seen, default=n)


def fill(t: Trace, array: Array, values: Vector) -> None:
    """All entries of an array."""
    put(t, array.__setitem__, values)


def kept_in_array(t: Trace, x: list[Value], before: list[Value]) -> list[Value]:
    """The new state in a local array until it is stored, but for what has not moved."""
    array = t.array("x_next", len(x))
    moved = {i for i, (value, old) in enumerate(zip(x, before, strict=True)) if value.node is not old.node}
    for i in sorted(moved):
        array[i] = x[i]
    return [array[i] if i in moved else value for i, value in enumerate(x)]
