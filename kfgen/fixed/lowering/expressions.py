"""Real expressions to integer ones: where every shift, rounding and saturation is decided.

A value is an integer node, the exponent e of its LSB and the interval of the integers that it can be, whatever the
filter is given. An operation that the interval proves to fit is plain C; every other saturates and says so.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import ceil, floor

from kfgen.fixed.arithmetic.limits import BITS, LIMIT
from kfgen.fixed.arithmetic.rounding import power, size_of
from kfgen.fixed.lowering.functions import Functions
from kfgen.fixed.lowering.raw import UNSEEN, QTable, Raw, at
from kfgen.fixed.program.cells import is_variance, number_of, plain
from kfgen.fixed.program.nodes import boolean, constant, fold, make
from kfgen.ir.nodes import Constants, Node, Table


class Expressions(Functions):
    """Lowers the expressions of one function."""

    def index(self, node: Node) -> Node:
        """An expression of integers or truth values."""
        match node.op:
            case "const" | "counter" | "field" | "bit" | "present":
                return node
            case "variable":
                return self.c.known.get(node.data, node)
            case "finite":
                return boolean(True)
            case "lt" | "le" if node.args[0].kind == "real":
                return self.compare(node)
            case "segment":
                return self.segment(node)
        args = tuple(self.index(a) for a in node.args)
        folded = fold(node.op, args, node.kind)
        return folded if folded is not None else make(node.op, args, node.data, node.kind)

    def compare(self, node: Node) -> Node:
        """a < b or a <= b, the coarser shifted left where it has room."""
        left, right = node.args
        if right.constant is not None:
            return self.beside(node, self.value(left), False)
        if left.constant is not None:
            return self.beside(node, self.value(right), True)
        a, b = self.value(left), self.value(right)
        e = min(a.e, b.e)
        coarse = a if a.e > e else b
        if coarse.e > e and coarse.size * 2 ** (coarse.e - e) > LIMIT:
            e = coarse.e
        return make(node.op, (self.at(a, e).node, self.at(b, e).node), None, "bool")

    def beside(self, node: Node, a: Raw, above: bool) -> Node:
        """The comparison of a value with a constant, which is on the left where the value is to be above it."""
        strict = node.op == "lt"
        limit = (node.args[0 if above else 1].constant or 0) / power(a.e)
        if not above:
            return self._bounded(a, ceil(limit) - 1 if strict else floor(limit))
        inner = self._bounded(a, floor(limit) if strict else ceil(limit) - 1)
        return boolean(not inner.constant) if inner.constant is not None else self._above(a, limit, strict)

    def _bounded(self, a: Raw, most: int) -> Node:
        """a <= most."""
        if a.high <= most:
            return boolean(True)
        if a.low > most:
            return boolean(False)
        return make("lt", (a.node, constant(most + 1)), None, "bool")

    def _above(self, b: Raw, limit: Fraction, strict: bool) -> Node:
        """limit < b, or limit <= b."""
        least = floor(limit) if strict else ceil(limit) - 1
        return make("lt", (constant(least), b.node), None, "bool")

    def segment(self, node: Node) -> Node:
        a = self.value(node.args[0])
        table = self.table(node.data, a.e)
        return make("segment", (a.node,), table, "int")

    def table(self, table: Table, e: int) -> QTable:
        """Its integers, for arguments with that exponent; a table has one format of its abscissae."""
        found = self.c.tables.get(table)
        if found is None:

            def least(values: tuple[Fraction, ...]) -> int:
                return max((size_of(v) for v in values if v), default=0) - BITS + 1

            found = self.c.tables[table] = QTable(table, (e, least(table.values()), least(table.slopes())))
        return found

    def _value(self, node: Node, e: int | None) -> Raw:
        c = self.c
        match node.op:
            case "const":
                return self.literal(node.data, e)
            case "variable":
                if node.data in c.inverses:
                    return self.inverse(node, e)
                if node.data in c.ratios:
                    num, den, condition = c.ratios[node.data]
                    e = self.natural(c.nodes[node.data]) if e is None else e
                    return self.guarded(self._divided(num, den, e or 0), condition)
                return c.locals[node.data]
            case "field":
                cell = number_of(c.function, node.data)
                return self.cell(node, cell, self.outside(node.data))
            case "element":
                place = make(node.op, (self.index(node.args[0]),), node.data)
                cell = c.arrays.named(c.function, node.data, node.args[0])
                if node.data == "kf.mu":
                    return self.probability(place)
                raw = self.cell(place, cell, plain(node.data) in ("kf.x", "x", "P", "S"))
                return replace(raw, low=0) if is_variance(node.data, node.args[0]) else raw
            case "read":
                if not node.args:
                    return self.cell(node, ("variable", c.function.name, node.data), False)
                cell = c.arrays.named(c.function, node.data, node.args[0])
                return self.cell(make(node.op, (self.index(node.args[0]),), node.data), cell, False)
            case "real":
                return Raw(make("q_count", (self.index(node.args[0]),)), 0, 0, LIMIT)
            case "lookup":
                return self.lookup(node)
            case "select":
                return self.select(node, e)
            case "sum" | "add" | "sub":
                return self.sum(node, e)
            case "neg":
                return self.negative(self.value(node.args[0], e))
            case "mul":
                return self.product(node, e)
            case "div":
                return self.quotient(node, e)
        return self.function(node, e)

    def lookup(self, node: Node) -> Raw:
        source: Constants = node.data
        found = self.c.lookups.get(source)
        if found is None:
            e = max((size_of(v) for v in source.numbers if v), default=0) - BITS + 1
            numbers = at(source.numbers, e)
            found = self.c.lookups[source] = (Constants(numbers, source.name), e)
        constants, e = found
        size = max((abs(int(v)) for v in constants.numbers), default=0)
        return Raw(make("lookup", (self.index(node.args[0]),), constants), e, -size, size)

    def select(self, node: Node, e: int | None) -> Raw:
        condition = self.index(node.args[0])
        if condition.constant is not None:
            return self.value(node.args[1] if condition.constant else node.args[2], e)
        if e is None:
            e = self.natural(node)
            live = [self.value(n).e for n in node.args[1:] if n.constant is None and self.seen(n)]
            if e is not None and live:
                e = max(e, min(live))
            if e is not None and not all(map(self.seen, node.args[1:])):
                e += UNSEEN
        a, b = (self.value(n, e) for n in node.args[1:])
        if e is None:
            fitting = [size_of(n.constant) - BITS if n.constant else r.e
                       for n, r in zip(node.args[1:], (a, b), strict=True) if n.constant != 0]  # fmt: skip
            e = max(fitting, default=0)
            a, b = (self.value(n, e) for n in node.args[1:])
        return Raw(make("select", (condition, a.node, b.node)), e, min(a.low, b.low), max(a.high, b.high))
