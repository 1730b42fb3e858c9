"""Integers that stand for real numbers while expressions are lowered: binary point, interval, context."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction

from kfgen.fixed.arithmetic.limits import LIMIT
from kfgen.fixed.arithmetic.rounding import rounded
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.program.nodes import same
from kfgen.ir.nodes import Constants, Node, Table
from kfgen.ir.program import Function

FIRST = 17  # the least shift of a product that has been proved to fit
LAST = 32  # the largest
ROOMIER = 3  # bits that a product may lose so that it is proved to fit
UNSEEN = 4  # bits for a choice that no run has made
USEFUL = 20  # bits: a product of two full factors has no use for more than 62 less these


@dataclass(frozen=True)
class Raw:
    """An integer node with the exponent of its LSB and its interval."""

    node: Node
    e: int
    low: int = -LIMIT
    high: int = LIMIT
    clipped: Node | None = None  # the same, clipped to INSIDE, in one operation

    @property
    def size(self) -> int:
        return max(-self.low, self.high)


@dataclass
class Context:
    """What the expressions of one function are lowered with."""

    function: Function
    formats: Formats
    arrays: Arrays
    tables: dict[Table, QTable] = field(default_factory=dict)
    lookups: dict[Constants, tuple[Constants, int]] = field(default_factory=dict)
    locals: dict[str, Raw] = field(default_factory=dict)
    known: dict[str, Node] = field(default_factory=dict)  # integer and truth values that folded
    nodes: dict[str, Node] = field(default_factory=dict)  # the real expressions of locals
    planned: dict[str, int] = field(default_factory=dict)  # exponents of locals that make the products they are in fit
    unlimited: set[str] = field(default_factory=set)  # locals that are only divided by, or compared
    signs: dict[Node, bool] = field(default_factory=dict)  # whether a value is known not to be negative
    inverses: dict[str, tuple[Raw, Node | None]] = field(default_factory=dict)  # 1/x, 0 unless the condition holds
    ratios: dict[str, tuple[Raw, Raw, Node | None]] = field(default_factory=dict)  # a/b, 0 unless the condition holds


@dataclass(frozen=True)
class QTable:
    """A table in integers, and the exponents of its abscissae, ordinates and slopes."""

    source: Table
    e: tuple[int, int, int]

    @property
    def x(self) -> tuple[Fraction, ...]:
        return at(self.source.x, self.e[0])

    def starts(self) -> tuple[Fraction, ...]:
        return at(self.source.starts(), self.e[0])

    def values(self) -> tuple[Fraction, ...]:
        return at(self.source.values(), self.e[1])

    def slopes(self) -> tuple[Fraction, ...]:
        return at(self.source.slopes(), self.e[2])


def at(numbers: Iterable[Fraction], e: int) -> tuple[Fraction, ...]:
    """Numbers of a table in integers whose LSB is 2^e."""
    return tuple(Fraction(rounded(v, e)) for v in numbers)


def interval(a: Raw, b: Raw, s: int) -> tuple[int, int]:
    """Of round(a b / 2^s)."""
    if a.node is b.node or same(a.node, b.node):
        ends = [0, max(a.low * a.low, a.high * a.high)]
    else:
        ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    half = 1 << s >> 1
    return (min(ends) + half) >> s, (max(ends) + half) >> s
