"""Products, and sums of two, in integers."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from kfgen.fixed.arithmetic.limits import BITS, INSIDE, LIMIT
from kfgen.fixed.arithmetic.rounding import power, size_of
from kfgen.fixed.lowering.quotients import Quotients
from kfgen.fixed.lowering.raw import FIRST, LAST, ROOMIER, USEFUL, Raw, interval
from kfgen.fixed.program.nodes import constant, make, terms
from kfgen.ir.nodes import Node

NOTHING = 8  # bits below what a quotient has a use for: a value that is so small is zero but for round-off


class Products(Quotients):
    """Lowers products."""

    def constant_first(self, factors: tuple[Node, ...]) -> tuple[Node, Node]:
        """Two factors, a constant before what is none."""
        a, b = map(self.folded, factors)
        return (b, a) if b.constant is not None else (a, b)

    def product(self, node: Node, e: int | None) -> Raw:
        a, b = self.constant_first(node.args)
        if a.constant == 0:
            return self.literal(Fraction(0), e)
        if a.constant is not None and not self._inverse_of(b):
            exact = self.literal(a.constant, None)
            if abs(int(exact.node.constant or 0)) == 1:
                rb = self.value(b)
                rb = replace(rb, e=rb.e + exact.e)
                return rb if exact.node.constant == 1 else self.negative(rb)
        fine = e is None
        if e is None:
            e = self.natural(node)
        if e is None:
            e = self._guess((a, b)) if a.constant is None else self._guess((b,)) + size_of(a.constant)
        elif fine and not self._special(a, b):
            if a.constant is None:  # what one LSB of either factor makes is below any use
                e = max(e, self.value(a).e + self.value(b).e + USEFUL)
            else:
                e = max(e, self.value(b).e + size_of(a.constant) - 4)
        elif fine:
            finest = self._finest(node, a, b)
            e = e if finest is None else max(e, finest)
        return self._product(a, b, e)

    def _guess(self, factors: tuple[Node, ...]) -> int:
        raws = [self.value(f) for f in factors]
        return raws[0].e if len(raws) == 1 else raws[0].e + raws[1].e + BITS

    def _product(self, a: Node, b: Node, e: int) -> Raw:
        a, b = self.folded(a), self.folded(b)
        if self._inverse_of(a):
            a, b = b, a
        inverse = self._inverse_of(b)
        if inverse is not None:
            den, condition = inverse
            return self.guarded(self._divided(self.value(a), den, e), condition)
        if self.ratio_of(a):
            a, b = b, a
        ratio = self.ratio_of(b)
        if ratio is not None:
            return self.guarded(self._ratio(ratio, self.value(a), e), ratio[2])
        if b.constant is not None:
            a, b = b, a
        ra, rb, s, most = self._factors(a, b, e)
        if ra is None or rb is None:
            return Raw(constant(0), e, 0, 0)
        if s == 0 and ra.node.constant == 1:
            return rb
        if not 0 <= s <= 62:
            return self._shifted_product(ra, rb, e)
        return self._mul(ra, rb, s, e, most)

    def _mul(self, a: Raw, b: Raw, s: int, e: int, most: int | None = None) -> Raw:
        a, b, s, most = self._within(a, b, s, most)
        low, high = self.span(a, b, s, most)
        args = (constant(0), a.node, b.node)
        if self.small(a) and self.small(b) and s >= FIRST and low >= -LIMIT and high <= LIMIT:
            return Raw(make("q_fma", args, (s,)), e, low, high, make("q_mac", args, (s,)))
        if self.small(a) and self.small(b) and FIRST <= s <= LAST:
            return Raw(make("q_mac", args, (s,)), e, max(low, -INSIDE), min(high, INSIDE))
        return Raw(make("q_mul", (a.node, b.node), (s,)), e, max(low, -LIMIT), min(high, LIMIT))

    def scaled_product(self, a: Raw, b: Raw, e: int) -> Raw:
        """a b at e."""
        s = e - a.e - b.e
        return self._mul(a, b, s, e) if 0 <= s <= 62 else self._shifted_product(a, b, e)

    def _within(self, a: Raw, b: Raw, s: int, most: int | None) -> tuple[Raw, Raw, int, int | None]:
        """Factors of which one has so few digits that s is at most LAST: it costs 1/8 of the product's LSB."""
        extra = s - LAST
        if extra <= 0 or not (self.small(a) and self.small(b)):
            return a, b, s, most
        most = None if most is None else (most >> extra) + (1 << BITS)
        if a.node.constant is None:
            return self.at(a, a.e + extra), b, LAST, most
        return a, self.at(b, b.e + extra), LAST, most

    def _shifted_product(self, a: Raw, b: Raw, e: int) -> Raw:
        """a b at e where the shift between is beyond what one operation does."""
        s = e - a.e - b.e
        if s > 62:  # both are shrunk as far as it takes
            extra = min(s - 62, 62)
            return self._mul(self.at(a, a.e + extra), b, s - extra, e) if s - extra <= 62 else Raw(constant(0), e, 0, 0)
        return self.at(self._mul(a, b, 0, a.e + b.e), e)

    def _factors(self, a: Node, b: Node, e: int) -> tuple[Raw | None, Raw | None, int, int | None]:
        """Two factors, the shift that brings their product to e, and what the product cannot exceed, if it is known.

        A constant takes the digits that there are.
        """
        if a.constant is None:
            ra, rb = self.factor(a), self.factor(b)
            return ra, rb, e - ra.e - rb.e, self.share(a, b, ra, rb)
        rb = self.factor(b)
        value = a.constant
        if not self.small(rb) and abs(value) <= Fraction(1, 4) and e >= rb.e - 1:
            rb = self.at(rb, rb.e + 2)  # what the user gives has more bits than a plain product takes
        if value == 0 or rb.size == 0:
            return None, None, 0, None
        exact = self.literal(value, None)
        if abs(int(exact.node.constant or 0)) == 1:  # a power of two: only the exponent changes
            sign = int(exact.node.constant or 0)
            rb = replace(rb, e=rb.e + exact.e)
            rb = rb if sign > 0 else self.negative(rb)
            return Raw(constant(1), 0, 1, 1), self.at(rb, e), 0, None
        s = e - rb.e - exact.e
        if s < 0:
            exact = self.literal(value, e - rb.e)
        elif s < FIRST and exact.size << (FIRST - s) <= INSIDE:
            exact = self.literal(value, e - rb.e - FIRST)
        elif s > LAST:  # fewer digits of the constant, but 22 of them
            exact = self.literal(value, e - rb.e - max(LAST, min(s - 8, 62)))
        if exact.node.constant == 0:
            return None, None, 0, None
        return exact, rb, e - rb.e - exact.e, None

    def factor(self, node: Node) -> Raw:
        """A value to be multiplied: inside of its range, unless it is the user's."""
        raw = self.value(node)
        return raw if node.op in ("field", "element", "variable") else self.fit(raw)

    def span(self, a: Raw, b: Raw, s: int, most: int | None) -> tuple[int, int]:
        """The interval of round(a b / 2^s); most: what is known of a b, which then is not negative."""
        if most is None:
            return interval(a, b, s)
        return 0, (most + (1 << s >> 1)) >> s

    def _plus(self, total: Raw | None, sign: int, raw: Raw, e: int) -> Raw:
        if total is None:
            return raw if sign > 0 else self.negative(raw)
        if raw.node.constant == 0:
            return total
        if total.node.constant == 0:
            return raw if sign > 0 else self.negative(raw)
        if raw.node.constant is not None and raw.node.constant < 0:
            raw, sign = self.negative(raw), -sign
        low = total.low + (raw.low if sign > 0 else -raw.high)
        high = total.high + (raw.high if sign > 0 else -raw.low)
        op = "add" if sign > 0 else "sub"
        if low >= -LIMIT and high <= LIMIT:
            if total.node.op == "neg" and sign > 0:
                return Raw(make("sub", (raw.node, total.node.args[0])), e, low, high)
            return Raw(make(op, (total.node, raw.node)), e, low, high)
        return Raw(make(f"q_{op}", (total.node, raw.node)), e, max(low, -LIMIT), min(high, LIMIT))

    def useful(self, node: Node, e: int | None) -> int | None:
        """No finer than the digits that the operands have: what is zero but for round-off has no range of its own."""
        e = self.natural(node) if e is None else e
        floor_ = self.digits(node)
        return e if e is None or floor_ is None else max(e, floor_)

    def digits(self, node: Node) -> int | None:
        """The finest exponent that has a use for the value of an expression; None where it may be any."""
        match node.op:
            case "const":
                return None
            case "neg":
                return self.digits(node.args[0])
            case "mul":
                a, b = self.constant_first(node.args)
                if self._special(a, b):
                    return self._finest(node, a, b)
                if a.constant is not None:
                    inner = self.digits(b)
                    return None if inner is None or a.constant == 0 else inner + size_of(a.constant) - 4
                return self.value(a).e + self.value(b).e + USEFUL
            case "sum" | "add" | "sub":
                found = []
                for _, f in terms(node):
                    if f[0].constant is None or len(f) == 2:
                        found.append(self.digits(f[0] if len(f) == 1 else make("mul", f)))
                return None if not found or None in found else min(v for v in found if v is not None)
            case "variable" if node.data in self.c.inverses or node.data in self.c.ratios:
                return None
        return self.value(node).e

    def _finest(self, node: Node, a: Node, b: Node) -> int | None:
        """The finest exponent that a division of one by what the other is the reciprocal of has a use for, where runs
        have shown nothing but round-off of it."""
        if self._inverse_of(a) is not None:
            a, b = b, a
        inverse = self._inverse_of(b)
        if inverse is None or a.constant is not None or self._special(a):
            return None
        finest, natural = self.finest(self.value(a), inverse[0]), self.natural(node)
        return finest if natural is not None and finest > natural + NOTHING else None

    def roomier(self, node: Node, e: int | None) -> int | None:
        """An exponent a little coarser at which a product is proved to fit, if there is one."""
        a, b = map(self.folded, node.args)
        natural = self.natural(node)
        if natural is None or self._special(a, b):
            return e
        if e is None:
            return None
        raws = [self.value(f) for f in (a, b) if f.constant is None]
        bound = Fraction(1)
        for raw in raws:
            bound *= raw.size * power(raw.e)
        for f in (a, b):
            bound *= 1 if f.constant is None else abs(f.constant)
        needed = size_of(bound) - BITS if bound else e
        return needed if e < needed <= natural + ROOMIER else e
