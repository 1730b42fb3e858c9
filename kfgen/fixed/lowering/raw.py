"""Integers that stand for real numbers while expressions are lowered: binary point, interval, context."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from math import floor

from kfgen.fixed.formats.choose import Formats
from kfgen.fixed.program.cells import Arrays, plain
from kfgen.fixed.program.unroll import make
from kfgen.ir.nodes import Constants, Node, Table
from kfgen.ir.program import Function

LIMIT = 2**31 - 1
INSIDE = 2**30 - 1  # what every number inside is clipped to: then a product of two by 2^-30, and a sum of two, fit
LEAST = -(2**31)
DYNAMIC = 1024  # a reciprocal whose runs span more than this is made with each quotient
FIRST = 17  # the least shift of a product that has been proved to fit
ROOMIER = 3  # bits that a product may lose so that it is proved to fit
SPREAD = 2.0**12  # times its usual size: a quotient that becomes so large is made with each product that it is in
UNSEEN = 4  # bits for a choice that no run has made
LAST = 32  # the largest
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
        return tuple(rounded(v, self.e[0]) for v in self.source.x)

    def starts(self) -> tuple[Fraction, ...]:
        return tuple(rounded(v, self.e[0]) for v in self.source.starts())

    def values(self) -> tuple[Fraction, ...]:
        return tuple(rounded(v, self.e[1]) for v in self.source.values())

    def slopes(self) -> tuple[Fraction, ...]:
        return tuple(rounded(v, self.e[2]) for v in self.source.slopes())


def rounded(value: Fraction, e: int) -> Fraction:
    """value / 2^e to the nearest integer that fits."""
    return Fraction(max(-LIMIT, min(LIMIT, nearest(value, e))))


def power(e: int) -> Fraction:
    return Fraction(2) ** e


def nearest(value: Fraction, e: int) -> int:
    """value / 2^e to the nearest integer, ties upwards."""
    return floor(value / power(e) + Fraction(1, 2))


def size_of(value: Fraction) -> int:
    """The least k with |value| < 2^k."""
    magnitude = abs(value)
    k = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    while magnitude >= power(k):
        k += 1
    while magnitude < power(k - 1):
        k -= 1
    return k


def constant(value: int) -> Node:
    return make("const", (), Fraction(value))


def interval(a: Raw, b: Raw, s: int) -> tuple[int, int]:
    """Of round(a b / 2^s)."""
    if a.node is b.node or same(a.node, b.node):
        ends = [0, max(a.low * a.low, a.high * a.high)]
    else:
        ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    half = 1 << s >> 1
    return (min(ends) + half) >> s, (max(ends) + half) >> s


def is_variance(path: str, index: Node) -> bool:
    """Whether an element of the struct is a variance: what is stored there is never below zero."""
    if plain(path) == "kf.D":
        return True
    if plain(path) != "kf.P" or index.constant is None:
        return False
    place, j = int(index.constant), 0
    while j * (j + 3) // 2 < place:
        j += 1
    return j * (j + 3) // 2 == place


def same(a: Node, b: Node) -> bool:
    """Whether two expressions are one by their text."""
    if a is b:
        return True
    return (
        a.op == b.op and a.data == b.data and len(a.args) == len(b.args)
        and a.op not in ("read",) and all(same(x, y) for x, y in zip(a.args, b.args, strict=True))
    )  # fmt: skip
