"""Values in the integer formats that they are given, and signs that are known whatever happens."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from kfgen.fixed.arithmetic.limits import BITS, FINE, INSIDE, LEAST, LIMIT
from kfgen.fixed.arithmetic.rounding import nearest, power, rounded, size_of
from kfgen.fixed.formats.formats import SLACK
from kfgen.fixed.lowering.raw import Context, Raw
from kfgen.fixed.program.cells import is_variance
from kfgen.fixed.program.nodes import constant, make, same, terms
from kfgen.ir.nodes import Node


class Values(ABC):
    """What all operations need: formats, shifts, limits."""

    def __init__(self, context: Context) -> None:
        self.c = context

    @abstractmethod
    def index(self, node: Node) -> Node:
        """An expression of integers or truth values."""

    @abstractmethod
    def _value(self, node: Node, e: int | None) -> Raw:
        """A number, in the format 2^e where it is given."""

    def value(self, node: Node, e: int | None = None) -> Raw:
        """A real expression in the format that suits it, or in that of exponent e."""
        raw = self._value(node, e)
        self._proved(node, raw)
        if raw.low < 0 and node.op in ("sum", "mul", "div", "select", "sqrt") and self.nonnegative(node):
            raw = replace(raw, low=0)
        return raw if e is None else self.at(raw, e)

    def _proved(self, node: Node, raw: Raw) -> None:
        """Note the operations of a value that fit anywhere in the declared box, whatever their intervals allow."""
        largest = self.c.formats.sizes.get(node)
        if largest is None or not 0 < SLACK * largest < math.ldexp(INSIDE, raw.e):
            return
        waiting = [raw.node, *([] if raw.clipped is None else [raw.clipped])]
        while waiting:  # a sum is a chain of operations in one format, which begins with the sum so far
            op = waiting.pop()
            if op.op in ("q_mac", "q_fma", "q_add", "q_sub", "q_fit", "add", "sub"):
                self.c.formats.fitting[id(op)] = op
                waiting.append(op.args[0])
            elif op.op in ("q_mul", "q_shift"):
                self.c.formats.fitting[id(op)] = op

    def seen(self, node: Node) -> bool:
        """Whether the runs have told the range of a value."""
        if node.op in ("element", "field", "read", "variable", "const"):
            return True
        return self.natural(node) is not None

    def natural(self, node: Node) -> int | None:
        return self.c.formats.node(node)

    def at(self, a: Raw, e: int) -> Raw:
        """The same value in another format."""
        s = e - a.e
        if s == 0:
            return a
        if a.node.constant is not None:
            raw = nearest(a.node.constant, s)
            if abs(raw) <= LIMIT:
                return Raw(constant(raw), e, raw, raw)
        if s > 0:
            low, high = (nearest(Fraction(v), s) for v in (a.low, a.high))
            return Raw(make("q_shift", (a.node,), (min(s, 62),)), e, low, high)
        if -s < LIMIT.bit_length() and a.size << -s <= LIMIT:
            return Raw(make("mul", (a.node, constant(1 << -s))), e, a.low << -s, a.high << -s)
        return Raw(make("q_shift", (a.node,), (max(s, -62),)), e)

    def outside(self, path: str) -> bool:
        """Whether a field is written by the user, and may hold any integer."""
        return not path.startswith("kf.") or path.startswith(("kf.parameters.", "kf.nis", "kf.log_likelihood"))

    def cell(self, node: Node, cell: tuple[object, ...], outside: bool) -> Raw:
        e = self.c.formats.of(cell)
        low, high = (LEAST, LIMIT) if outside else (-INSIDE, INSIDE)
        return Raw(node, -self.c.formats.bits if e is None else e, low, high)

    def probability(self, node: Node) -> Raw:
        """An element of mu, which the user may have set: between 0 and 1, with the digits that its rest has."""
        bits = self.c.formats.bits
        place, k = node.args, max(0, FINE - bits)
        node = between(node, 1 << bits)
        if k:
            rest = make("element", place, "kf.rest")
            node = between(make("add", (make("mul", (node, constant(1 << k))), rest)), 1 << FINE)
        return Raw(node, -bits - k, 0, 1 << (bits + k))

    def literal(self, value: Fraction, e: int | None) -> Raw:
        if value == 0:
            return Raw(constant(0), e or 0, 0, 0)
        if e is None:
            e = size_of(value) - BITS + 1
            while (value / power(e)).denominator == 1 and (value / power(e + 1)).denominator == 1:
                e += 1  # exact with fewer digits
        raw = rounded(value, e)
        return Raw(constant(raw), e, raw, raw)

    def negative(self, a: Raw) -> Raw:
        if a.node.constant is not None:
            return Raw(constant(-int(a.node.constant)), a.e, -a.high, -a.low)
        if a.node.op == "neg":
            return replace(a, node=a.node.args[0], low=-a.high, high=-a.low)
        if a.low < -LIMIT:
            return Raw(make("q_sub", (constant(0), a.node)), a.e)
        return Raw(make("neg", (a.node,)), a.e, -a.high, -a.low)

    def small(self, a: Raw) -> bool:
        return a.size <= INSIDE

    def fit(self, a: Raw) -> Raw:
        """Clipped to what is allowed inside."""
        if self.small(a):
            return a
        if a.clipped is not None:
            return Raw(a.clipped, a.e, max(a.low, -INSIDE), min(a.high, INSIDE))
        node = make("q_fit", (a.node,))
        if id(a.node) in self.c.formats.fitting:
            self.c.formats.fitting[id(node)] = node
        return Raw(node, a.e, max(a.low, -INSIDE), min(a.high, INSIDE))

    def together(self, nodes: Sequence[Node]) -> list[Raw]:
        """Values in one format: the finest in which all of them fit."""
        raws = [self.value(n) for n in nodes if n.constant is None]
        e = min((r.e for r in raws), default=-BITS)
        for n in nodes:
            if n.constant:
                e = max(e, size_of(n.constant) - BITS)
        for r in raws:  # what the interval allows must fit when it is shifted left, or has no meaning
            while r.e > e and r.size << (r.e - e) > LIMIT:
                e += 1
        return [self.value(n, e) for n in nodes]

    def _placed(self, a: Raw) -> Raw:
        """With 0 to 30 fraction bits, as functions take their arguments."""
        return self.at(a, min(max(a.e, -30), 0))

    def folded(self, node: Node) -> Node:
        """A local that turned out to be a constant, as that constant."""
        raw = self.c.locals.get(node.data) if node.op == "variable" else None
        if raw is None or raw.node.constant is None:
            return node
        return make("const", (), raw.node.constant * power(raw.e))

    def definition(self, node: Node) -> Node:
        """What a local stands for."""
        while node.op == "variable" and node.data in self.c.nodes:
            node = self.c.nodes[node.data]
        return node

    def nonnegative(self, node: Node) -> bool:
        """Whether a value cannot be below zero, in integers as in real numbers, whatever the filter is given."""
        found = self.c.signs.get(node)
        if found is None:
            self.c.signs[node] = False
            found = self.c.signs[node] = self._nonnegative(self.definition(node))
        return found

    def _nonnegative(self, node: Node) -> bool:
        match node.op:
            case "const":
                return bool(node.data >= 0)
            case "element":
                return node.data == "kf.mu" or is_variance(node.data, node.args[0])
            case "sum" | "add":
                return all(sign > 0 and (self.nonnegative(f[0]) if len(f) == 1 else self._square(*f))
                           for sign, f in terms(node))  # fmt: skip
            case "mul":
                return self._square(*node.args)
            case "div":
                return all(map(self.nonnegative, node.args))
            case "select":
                return all(map(self.nonnegative, node.args[1:]))
            case "sqrt" | "abs" | "exp":
                return True
        return False

    def _square(self, a: Node, b: Node) -> bool:
        """Whether a b is not negative: two that are not, or x (x d) with d that is not."""
        if self.nonnegative(a) and self.nonnegative(b):
            return True
        for x, other in ((a, b), (b, a)):
            if same(x, other):
                return True
            inner = self.definition(other)
            if inner.op == "mul":
                for y, d in (inner.args, inner.args[::-1]):
                    if same(x, y) and self.nonnegative(d):
                        return True
        return False

    def share(self, a: Node, b: Node, ra: Raw, rb: Raw) -> int | None:
        """A bound of the product of a part of a whole, and the whole's reciprocal."""
        for part, inverse, raw, over in ((a, b, ra, rb), (b, a, rb, ra)):
            quotient = self.definition(inverse)
            if quotient.op != "div" or quotient.args[0].constant != 1 or not self.nonnegative(part):
                continue
            whole = quotient.args[1]
            if whole.op != "variable" or whole.data not in self.c.locals:
                continue
            inner = self.definition(whole)
            if inner.op not in ("sum", "add") or not self.nonnegative(whole):
                continue
            if any(sign > 0 and len(f) == 1 and same(f[0], part) for sign, f in terms(inner)):
                e = self.c.locals[whole.data].e
                if e <= raw.e and raw.size << (raw.e - e) <= INSIDE:  # neither rounded nor clipped when it was added
                    return (1 << max(-raw.e - over.e, 0)) + (1 << BITS)
        return None


def between(node: Node, most: int) -> Node:
    """Brought between 0 and most."""
    return make("q_min", (make("q_max", (node, constant(0))), constant(most)))
