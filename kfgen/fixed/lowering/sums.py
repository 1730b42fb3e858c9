"""Sums of products in integers: where they are added, and in which format."""

from __future__ import annotations

from fractions import Fraction

from kfgen.fixed.arithmetic.limits import INSIDE, LIMIT
from kfgen.fixed.arithmetic.rounding import power
from kfgen.fixed.lowering.products import Products
from kfgen.fixed.lowering.raw import FIRST, Raw
from kfgen.fixed.program.nodes import constant, make, terms
from kfgen.ir.nodes import Node


class Sums(Products):
    """Lowers sums."""

    def sum(self, node: Node, e: int | None) -> Raw:
        parts = terms(node)
        needed = self.natural(node) if e is not None else self.useful(node, None)
        if needed is None:
            needed = e if e is not None else max(self._guess(f) for _, f in parts)
        least = needed - 2 if e is not None else needed  # a store's own head-room is enough
        plain = [(sign, f[0]) for sign, f in parts if len(f) == 1 and f[0].op != "mul"]
        if e is None:
            needed += any(self.value(f).e == needed + 1 for _, f in plain if f.constant is None)
        if e is None or e < least:
            e = self._sum_format(parts, plain, needed) if e is None else needed
        products = [(sign, f) for sign, f in parts if len(f) == 2 or f[0].op == "mul"]
        whole: list[tuple[int, Raw]] = []
        for sign, f in plain:
            raw = self.at(self.value(f, e if f.constant is not None or f.op in ("sum", "add", "sub") else None), e)
            whole.append((sign, raw))
        whole.sort(key=lambda item: item[1].low < -LIMIT or item[1].node.op in ("field",))
        late = [item for item in whole if item[1].low < -LIMIT] if products else []
        total: Raw | None = None
        for sign, raw in whole:
            if (sign, raw) not in late:
                total = self._plus(total, sign, raw, e)
        for sign, factors in products:
            total = self._madd(total, sign, factors, e)
        for sign, raw in late:
            total = self._plus(total, sign, raw, e)
        assert total is not None
        return total

    def _sum_format(self, parts: list[tuple[int, tuple[Node, ...]]], plain: list[tuple[int, Node]], needed: int) -> int:
        """The natural format of a sum: no finer than its terms are, and a difference of what the user gives fits."""
        if len(plain) < len(parts):
            return needed
        raws = [self.value(f) for _, f in plain if f.constant is None]
        if not raws:
            return needed
        e = max(needed, min(r.e for r in raws))
        if all(f.constant is None for _, f in plain):
            for _ in range(2):  # head-room for whatever is given, where digits are to spare
                bound = sum(Fraction(r.size) * power(r.e) for r in raws)
                if bound > (INSIDE + 1) * power(e) and e + 1 <= needed + 12:
                    e += 1
        return e

    def _madd(self, total: Raw | None, sign: int, factors: tuple[Node, ...], e: int) -> Raw:
        """total + sign times a product, at e."""
        if len(factors) == 1:
            factors = factors[0].args
        a, b = self.constant_first(factors)
        if self._special(a, b):
            product = self._product(a, b, e)
            return self._plus(total, sign, product, e)
        ra, rb, s, most = self._factors(a, b, e)
        if ra is None or rb is None:
            return self._plus(total, sign, Raw(constant(0), e, 0, 0), e) if total is None else total
        if s == 0 and ra.node.constant == 1:
            return self._plus(total, sign, self.at(rb, e), e)
        if not 0 <= s <= 62:
            return self._plus(total, sign, self._shifted_product(ra, rb, e), e)
        if sign < 0:
            if ra.low >= -LIMIT and (ra.node.constant is not None or rb.node.constant is None):
                ra = self.negative(ra)
            else:
                rb = self.negative(rb)
        if total is None:
            return self._mul(ra, rb, s, e, most)
        ra, rb, s, most = self._within(ra, rb, s, most)
        low, high = self.span(ra, rb, s, most if sign > 0 else None)
        if self.small(ra) and self.small(rb) and s >= FIRST:
            for begin in (total, self.fit(total)):
                if begin.low + low >= -LIMIT and begin.high + high <= LIMIT:
                    args = (begin.node, ra.node, rb.node)
                    clipped = make("q_mac", args, (s,)) if self.small(begin) else None
                    return Raw(make("q_fma", args, (s,)), e, begin.low + low, begin.high + high, clipped)
            node = make("q_mac", (self.fit(total).node, ra.node, rb.node), (s,))
            return Raw(node, e, max(total.low + low, -INSIDE), min(total.high + high, INSIDE))
        return self._plus(total, 1, self._mul(ra, rb, s, e, most), e)
