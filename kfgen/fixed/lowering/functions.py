"""Functions of real numbers as calls of integer routines."""

from __future__ import annotations

from fractions import Fraction

from kfgen.fixed.arithmetic.limits import BITS, LIMIT
from kfgen.fixed.arithmetic.rounding import nearest, size_of
from kfgen.fixed.lowering.raw import QTable, Raw
from kfgen.fixed.lowering.sums import Sums
from kfgen.fixed.program.cells import is_variance
from kfgen.fixed.program.nodes import integer, make, same, terms
from kfgen.ir.nodes import Node

COARSEST = 8  # bits of half a period, at least
_UNARY = {"sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh", "tanh"}


class Functions(Sums):
    """Lowers functions."""

    def function(self, node: Node, e: int | None) -> Raw:
        op = node.op
        if e is None or op in ("wrap", "sign", "floor"):
            natural = self.natural(node)
            e = natural if e is None else e
        match op:
            case "sqrt":
                return self.root(node, e)
            case "abs":
                a = self.fit(self.value(node.args[0], e))
                return Raw(make("q_abs", (a.node,)), a.e, 0, LIMIT)
            case "min" | "max":
                a, b = self.together(node.args)
                shared = a.e
                pick = min if op == "min" else max
                return Raw(make(f"q_{op}", (a.node, b.node)), shared, pick(a.low, b.low), pick(a.high, b.high))
            case "sign":
                a = self.value(node.args[0])
                return Raw(make("q_sign", (a.node,)), 0, -1, 1)
            case "wrap":
                a = self.value(node.args[0])
                # half a period, to 32 bits more, is an int64_t; and it has some digits, whatever the runs have met
                size = size_of(node.data / 2)
                a = self.at(a, min(max(a.e, size - 30), size - COARSEST))
                half = nearest(node.data / 2, a.e - 32)
                most = min(half >> 32, LIMIT)
                return Raw(make("q_wrap", (a.node,), (half,)), a.e, -most, most)
            case "floor":
                a = self.value(node.args[0])
                if a.e >= 0:
                    return a
                a = self.at(a, max(a.e, -30))
                return Raw(make("q_floor", (a.node,), (-a.e,)), a.e, max(a.low - (1 << -a.e), -LIMIT), a.high)
            case "table" | "slope":
                return self.interpolated(node, e)
        if e is None:
            e = -28 if op in ("sin", "cos", "atan", "asin", "acos", "atan2", "tanh") else -self.c.formats.bits
        if op in _UNARY:
            a = self._placed(self.value(node.args[0]))
            out = min(max(e, -30), 0)
            return Raw(make(f"q_{op}", (a.node,), (-a.e, -out)), out)
        if op == "atan2":
            a, b = self.together(node.args)
        else:
            a, b = (self._placed(self.value(n)) for n in node.args)
        out = min(max(e, -30), 0)
        if op == "atan2":
            out = max(out, -29)
            return Raw(make("q_atan2", (a.node, b.node), (-out,)), out)
        if op == "pow":
            # the routine's order: each number is followed by its fraction bits
            return Raw(make("q_pow", (a.node, integer(-a.e), b.node, integer(-b.e)), (-out,)), out)
        raise NotImplementedError(op)

    def root(self, node: Node, e: int | None) -> Raw:
        squares = self._squares(node.args[0])
        if squares is not None:
            raws = self.together(squares)
            total, shared = raws[0], raws[0].e
            for r in raws[1:]:
                total = Raw(make("q_hypot", (total.node, r.node)), shared, 0, LIMIT)
            return total
        factors = node.args[0].args
        if node.args[0].op == "mul" and all(a.op == "element" and is_variance(a.data, a.args[0]) for a in factors):
            return self.value(make("mul", tuple(make("sqrt", (a,)) for a in factors)), e)  # their product is too small
        a = self.value(node.args[0])
        if e is None:
            e = (a.e - BITS) // 2 + 1
        s = a.e - 2 * e
        if s > 62:
            e += (s - 61) // 2
        elif s < -62:
            e -= (-s - 61) // 2
        return Raw(make("q_sqrt", (a.node,), (a.e - 2 * e,)), e, 0, LIMIT)

    def _squares(self, node: Node) -> list[Node] | None:
        """The terms of a sum of squares: its root is a hypot, which needs no square."""
        if node.op != "sum":
            return None
        found = []
        for sign, factors in terms(node):
            if sign < 0 or len(factors) != 2 or not same(*factors):
                return None
            found.append(factors[0])
        return found if len(found) > 1 else None

    def interpolated(self, node: Node, e: int | None) -> Raw:
        segment = self.index(node.args[0])
        table: QTable = self.c.tables[node.data]
        ex, ey, es = table.e

        def entry(what: str, numbers: tuple[Fraction, ...], exponent: int) -> Raw:
            size = max(abs(int(v)) for v in numbers)
            return Raw(make(f"table_{what}", (segment,), table), exponent, -size, size)

        slope = entry("slope", table.slopes(), es)
        if node.op == "slope":
            return slope
        e = ey if e is None else e
        a = self.at(self.value(node.args[1]), ex)
        step = self._plus(self.at(a, ex + 1), -1, self.at(entry("x", table.starts(), ex), ex + 1), ex + 1)
        y = self.at(entry("y", table.values(), ey), e)
        s = e - step.e - es
        return self._plus(y, 1, self._mul(slope, step, s, e) if 0 <= s <= 62 else
                          self._shifted_product(slope, step, e), e)  # fmt: skip
