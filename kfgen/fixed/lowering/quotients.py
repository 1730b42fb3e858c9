"""Quotients in integers: kept, or made with each product that they are in."""

from __future__ import annotations

from kfgen.fixed.arithmetic.limits import BITS, LIMIT
from kfgen.fixed.lowering.raw import Raw
from kfgen.fixed.lowering.values import Values
from kfgen.fixed.program.nodes import constant, make
from kfgen.ir.nodes import Node


class Quotients(Values):
    """Lowers quotients and reciprocals."""

    def quotient(self, node: Node, e: int | None) -> Raw:
        fine = e is None
        if e is None:
            e = self.natural(node)
        a, b = node.args
        den = self.value(b)
        if fine and e is not None and a.constant is None:
            e = max(e, self.finest(self.value(a), den))
        if e is None:
            e = (0 if a.constant is not None else self.value(a).e) - den.e - BITS // 2
        return self._divided(self.value(a), den, e)

    def finest(self, a: Raw, b: Raw) -> int:
        """The finest exponent that a / b has a use for: its last digit is of what the last one of a makes."""
        return a.e - b.e - BITS - 3

    def _divided(self, a: Raw, b: Raw, e: int) -> Raw:
        """a / b at e."""
        s = a.e - b.e - e
        raw = a.node.constant
        if raw is not None and raw > 0 and (int(raw) & (int(raw) - 1)) == 0:
            bits = s + int(raw).bit_length() - 1
            if 0 <= bits <= 62:
                node = make("q_reciprocal", (b.node,), (bits,))
                if b.low > 0:
                    return Raw(node, e, 0, min(LIMIT, (1 << bits) // b.low + 1))
                return Raw(node, e, -LIMIT if b.low < 0 else 0)
        if s > 62:
            a = self.at(a, a.e - (s - 62))
            s = 62
        elif s < -62:
            return Raw(constant(0), e, 0, 0)
        return Raw(make("q_div", (a.node, b.node), (s,)), e)

    def inverse(self, node: Node, e: int | None) -> Raw:
        """A reciprocal that is not kept, used by itself."""
        den, condition = self.c.inverses[node.data]
        if e is None:
            e = self.c.formats.node(self.c.known[f"1/{node.data}"]) or -den.e - BITS
        return self.guarded(self._divided(Raw(constant(1), 0, 1, 1), den, e), condition)

    def _inverse_of(self, node: Node) -> tuple[Raw, Node | None] | None:
        if node.op == "div" and node.args[0].constant == 1 and self.c.formats.more:
            den = self.value(node.args[1])
            return (den, None) if den.low <= 0 else None
        return self.c.inverses.get(node.data) if node.op == "variable" else None

    def _special(self, *factors: Node) -> bool:
        """Whether a product is made by a division."""
        return any(self._inverse_of(f) is not None or self.ratio_of(f) is not None for f in factors)

    def guarded(self, quotient: Raw, condition: Node | None) -> Raw:
        """0 where the condition does not hold."""
        if condition is None:
            return quotient
        return Raw(make("select", (condition, quotient.node, constant(0))), quotient.e, -LIMIT, LIMIT)

    def ratio_of(self, node: Node) -> tuple[Raw, Raw, Node | None] | None:
        """Of a quotient that is not kept, numerator, denominator and condition."""
        return self.c.ratios.get(node.data) if node.op == "variable" else None

    def _ratio(self, ratio: tuple[Raw, Raw, Node | None], b: Raw, e: int) -> Raw:
        """A quotient times b, at e."""
        num, den, _ = ratio
        s = num.e + b.e - den.e - e
        if b.node.constant is not None and s > 62:
            return self._divided(num, den, e)
        return Raw(make("q_ratio", (num.node, b.node, den.node), (max(-62, min(62, s)),)), e)
