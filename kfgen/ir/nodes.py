"""Values of a program: immutable, hash-consed nodes, folded as they are made.

A node is an operation on other nodes. A `Pool` makes them: asking twice for the same operation gives the
same node, so equal expressions are shared and comparing nodes is comparing identities. Constants are exact
fractions and are rounded only by whoever prints or runs the program.

Kinds are "real", "bool", "int" (loop counters and indices) and "bits" (a word whose bits are looked at).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from kfgen.ir import constants

REAL, BOOL, INT, BITS = "real", "bool", "int", "bits"


@dataclass(frozen=True, slots=True)
class Table:
    """A piecewise linear function through n points, abscissae ascending, constant beyond the ends.

    It has n + 1 segments: before the first point, between points, from the last point on.
    """

    x: tuple[Fraction, ...]
    y: tuple[Fraction, ...]

    def starts(self) -> tuple[Fraction, ...]:
        """Where each segment's line is anchored."""
        return (self.x[0], *self.x)

    def values(self) -> tuple[Fraction, ...]:
        return (self.y[0], *self.y)

    def slopes(self) -> tuple[Fraction, ...]:
        points = list(zip(self.x, self.y, strict=True))
        inner = ((y1 - y0) / (x1 - x0) for (x0, y0), (x1, y1) in pairwise(points))
        return (Fraction(0), *inner, Fraction(0))


@dataclass(frozen=True, slots=True)
class Constants:
    """A table of numbers, looked up by a counter."""

    numbers: tuple[Fraction, ...]
    name: str


class Node:
    """One operation. `data` holds what is not a node: a constant, a reference, a table, the signs of a sum.

    sum: data is a tuple of (sign, number of factors) and args are all factors in order.
    load: data is the array's name, args the index (an int node). param: data is the C expression's name.
    """

    __slots__ = ("args", "data", "kind", "op", "serial", "volatile")

    def __init__(self, op: str, args: tuple[Node, ...], data: Any, kind: str, serial: int, volatile: bool) -> None:
        self.op = op
        self.args = args
        self.data = data
        self.kind = kind
        self.serial = serial  # creation order: operands come first
        self.volatile = volatile  # reads something that a later statement may change

    def __repr__(self) -> str:
        if self.op == "const":
            return str(self.data)
        inner = ", ".join(map(repr, self.args))
        return f"{self.op}[{self.data}]({inner})" if self.data is not None else f"{self.op}({inner})"

    @property
    def constant(self) -> Fraction | None:
        """The value, where the node is a constant."""
        return self.data if self.op == "const" else None


class Pool:
    """Makes nodes: shares equal ones, folds constants, zeros and ones.

    Folding 0 * x to 0 is right because a program tests its arguments for NaN and infinity.
    """

    def __init__(self) -> None:
        self._nodes: dict[tuple[Any, ...], Node] = {}
        self._count = 0
        self.zero = self.constant(0)
        self.one = self.constant(1)

    def make(self, op: str, args: tuple[Node, ...] = (), data: Any = None, kind: str = REAL,
             volatile: bool = False) -> Node:  # fmt: skip
        """The node of an operation as it stands, without folding; equal ones are one."""
        key = (op, args, data, kind)
        found = self._nodes.get(key)
        if found is None:
            volatile = volatile or any(a.volatile for a in args)
            found = self._nodes[key] = Node(op, args, data, kind, self._count, volatile)
            self._count += 1
            self._was_made(key, found)
        return found

    def _was_made(self, key: tuple[Any, ...], node: Node) -> None:
        """Called for every new node. key: by which it is found again."""

    def fresh(self, op: str, args: tuple[Node, ...], data: Any, kind: str) -> Node:
        """A volatile read: never the same node twice, for what it reads may have changed."""
        self._count += 1
        return Node(op, args, data, kind, self._count - 1, True)

    def constant(self, value: Fraction | int) -> Node:
        return self.make("const", (), Fraction(value))

    def integer(self, value: int) -> Node:
        return self.make("const", (), Fraction(value), INT)

    def boolean(self, value: bool) -> Node:
        return self.make("const", (), Fraction(int(value)), BOOL)

    # arithmetic ------------------------------------------------------------------------------------

    def add(self, a: Node, b: Node) -> Node:
        ca, cb = a.constant, b.constant
        if ca is not None and cb is not None:
            return self.make("const", (), ca + cb, a.kind)
        if ca == 0:
            return b
        if cb == 0:
            return a
        if b.op == "neg":
            return self.sub(a, b.args[0])
        if a.op == "neg":
            return self.sub(b, a.args[0])
        if cb is not None and cb < 0:
            return self.sub(a, self.make("const", (), -cb, a.kind))
        return self._commutative("add", a, b)

    def sub(self, a: Node, b: Node) -> Node:
        ca, cb = a.constant, b.constant
        if ca is not None and cb is not None:
            return self.make("const", (), ca - cb, a.kind)
        if cb == 0:
            return a
        if ca == 0:
            return self.neg(b)
        if a is b:
            return self.make("const", (), Fraction(0), a.kind)
        if b.op == "neg":
            return self.add(a, b.args[0])
        if a.op == "neg":  # -a - b: the sign goes outside, so that a + b is shared
            return self.neg(self.add(a.args[0], b))
        if cb is not None and cb < 0:
            return self.add(a, self.make("const", (), -cb, a.kind))
        opposite = self._nodes.get(("sub", (b, a), None, a.kind))
        return self.neg(opposite) if opposite is not None else self.make("sub", (a, b), kind=a.kind)

    def neg(self, a: Node) -> Node:
        if a.constant is not None:
            return self.make("const", (), -a.constant, a.kind)
        if a.op == "neg":
            return a.args[0]
        return self.make("neg", (a,), kind=a.kind)

    def mul(self, a: Node, b: Node) -> Node:
        ca, cb = a.constant, b.constant
        if ca is not None and cb is not None:
            return self.make("const", (), ca * cb, a.kind)
        if cb is not None:
            a, b, ca, cb = b, a, cb, ca
        if ca is not None:
            if ca == 0:
                return a
            if ca == 1:
                return b
            if ca < 0:  # constants are positive, so that what differs in sign only is shared
                return self.neg(self.mul(self.make("const", (), -ca, a.kind), b))
            if b.op == "mul" and b.args[0].constant is not None:
                return self.mul(self.make("const", (), ca * b.args[0].constant, a.kind), b.args[1])
            if b.op == "neg":
                return self.neg(self.mul(a, b.args[0]))
            return self.make("mul", (a, b), kind=a.kind)
        if a.op == "neg" or b.op == "neg":  # one sign outside: the sum around it takes it
            inner = self.mul(a.args[0] if a.op == "neg" else a, b.args[0] if b.op == "neg" else b)
            return inner if a.op == b.op else self.neg(inner)
        return self._commutative("mul", a, b)

    def div(self, a: Node, b: Node) -> Node:
        ca, cb = a.constant, b.constant
        if cb is not None and cb != 0:
            return self.mul(self.constant(1 / cb), a)
        if ca == 0:
            return a
        if a.op == "neg":
            return self.neg(self.div(a.args[0], b))
        if b.op == "neg":
            return self.neg(self.div(a, b.args[0]))
        return self.make("div", (a, b))

    def _commutative(self, op: str, a: Node, b: Node) -> Node:
        if (op, (b, a), None, a.kind) in self._nodes:
            a, b = b, a
        return self.make(op, (a, b), kind=a.kind)

    # functions -------------------------------------------------------------------------------------

    def function(self, op: str, *args: Node) -> Node:
        """sqrt, sin, ..., atan2, min, max, pow; of constants exactly (to 60 digits)."""
        values = [a.constant for a in args]
        if all(v is not None for v in values):
            folded = constants.fold(op, [v for v in values if v is not None])
            if folded is not None:
                return self.constant(folded)
        if op in ("min", "max") and args[0] is args[1]:
            return args[0]
        return self.make(op, args)

    def wrap(self, a: Node, period: Fraction) -> Node:
        """a in (-period/2, period/2], by whole periods."""
        if a.op == "wrap" and a.data == period:
            return a
        return self.make("wrap", (a,), period)

    def table(self, a: Node, table: Table, slope: bool = False) -> Node:
        """A piecewise linear function or its slope; both find the segment once."""
        segment = self.make("segment", (a,), table, INT)
        return self.make("slope", (segment,), table) if slope else self.make("table", (segment, a), table)

    def signs(self, a: Node, before: Node | None) -> Node:
        """A word that is 0 where the sign bit of a is not set, and `before` is 0."""
        return self.make("signs", (a,) if before is None else (before, a), kind=BITS)

    def some(self, word: Node) -> Node:
        """Whether a word is not 0."""
        return self.make("some", (word,), kind=BOOL)

    # truth -----------------------------------------------------------------------------------------

    def less(self, a: Node, b: Node) -> Node:
        return self._compare("lt", a, b)

    def less_equal(self, a: Node, b: Node) -> Node:
        return self._compare("le", a, b)

    def _compare(self, op: str, a: Node, b: Node) -> Node:
        ca, cb = a.constant, b.constant
        if ca is not None and cb is not None:
            return self.boolean(ca < cb if op == "lt" else ca <= cb)
        return self.make(op, (a, b), kind=BOOL)

    def both(self, a: Node, b: Node) -> Node:
        if a.constant is not None:
            return b if a.constant else a
        if b.constant is not None:
            return a if b.constant else b
        return a if a is b else self.make("and", (a, b), kind=BOOL)

    def either(self, a: Node, b: Node) -> Node:
        if a.constant is not None:
            return a if a.constant else b
        if b.constant is not None:
            return b if b.constant else a
        return a if a is b else self.make("or", (a, b), kind=BOOL)

    def negate(self, a: Node) -> Node:
        if a.constant is not None:
            return self.boolean(not a.constant)
        return a.args[0] if a.op == "not" else self.make("not", (a,), kind=BOOL)

    def select(self, condition: Node, a: Node, b: Node) -> Node:
        if condition.constant is not None:
            return a if condition.constant else b
        return a if a is b else self.make("select", (condition, a, b), kind=a.kind)
