"""Real expressions to integer ones: where every shift, rounding and saturation is decided.

A value is an integer node, the exponent e of its LSB and the interval of the integers that it can be, whatever the
filter is given. An operation that the interval proves to fit is plain C; every other saturates and says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import ceil, floor

from kfgen.fixed.cells import Arrays, affine, array_of, number_of, plain
from kfgen.fixed.formats import BITS, Formats
from kfgen.fixed.unroll import boolean, fold, integer, make
from kfgen.ir.nodes import Constants, Node, Table
from kfgen.ir.program import Function

LIMIT = 2**31 - 1
INSIDE = 2**30 - 1  # what every number inside is clipped to: then a product of two by 2^-30, and a sum of two, fit
LEAST = -(2**31)
DYNAMIC = 1024  # a reciprocal whose runs span more than this is made with each quotient
FIRST = 17  # the least shift of a product that has been proved to fit
ROOMIER = 3  # bits that a product may lose so that it is proved to fit
UNSEEN = 4  # bits for a choice that no run has made
LAST = 32  # the largest
USEFUL = 20  # bits: a product of two full factors has no use for more than 62 less these
_UNARY = {"sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh", "tanh"}


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
class Tally:
    """How many operations of a function were proved to fit, and how many saturate."""

    proved: int = 0
    guarded: int = 0


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
    tally: Tally = field(default_factory=Tally)
    risks: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class QTable:
    """A table in integers, and the exponents of its abscissae, ordinates and slopes."""

    source: Table
    e: tuple[int, int, int]

    @property
    def x(self) -> tuple[Fraction, ...]:
        return tuple(_rounded(v, self.e[0]) for v in self.source.x)

    def starts(self) -> tuple[Fraction, ...]:
        return tuple(_rounded(v, self.e[0]) for v in self.source.starts())

    def values(self) -> tuple[Fraction, ...]:
        return tuple(_rounded(v, self.e[1]) for v in self.source.values())

    def slopes(self) -> tuple[Fraction, ...]:
        return tuple(_rounded(v, self.e[2]) for v in self.source.slopes())


def _rounded(value: Fraction, e: int) -> Fraction:
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


class Expressions:
    """Lowers the expressions of one function."""

    def __init__(self, context: Context) -> None:
        self.c = context

    # integers and truth --------------------------------------------------------------------------------

    def index(self, node: Node) -> Node:
        """An expression of integers or truth values."""
        match node.op:
            case "const" | "counter" | "field" | "bit":
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
        strict = node.op == "lt"
        left, right = node.args
        if right.constant is not None:
            a = self.value(left)
            limit = right.constant / power(a.e)
            return self._bounded(a, ceil(limit) - 1 if strict else floor(limit))
        if left.constant is not None:
            b = self.value(right)
            limit = left.constant / power(b.e)
            inner = self._bounded(b, floor(limit) if strict else ceil(limit) - 1)
            return boolean(not inner.constant) if inner.constant is not None else self._above(b, limit, strict)
        a, b = self.value(left), self.value(right)
        e = min(a.e, b.e)
        coarse = a if a.e > e else b
        if coarse.e > e and coarse.size * 2 ** (coarse.e - e) > LIMIT:
            e = coarse.e
        return make(node.op, (self.at(a, e).node, self.at(b, e).node), None, "bool")

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

    # values --------------------------------------------------------------------------------------------

    def value(self, node: Node, e: int | None = None) -> Raw:
        """A real expression in the format that suits it, or in that of exponent e."""
        raw = self._value(node, e)
        if raw.low < 0 and node.op in ("sum", "mul", "div", "select", "sqrt") and self.nonnegative(node):
            raw = replace(raw, low=0)
        return raw if e is None else self.at(raw, e)

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
            raw = floor(Fraction(a.node.constant) / power(s) + Fraction(1, 2))
            if abs(raw) <= LIMIT:
                return Raw(constant(raw), e, raw, raw)
        if s > 0:
            low, high = (floor(v / power(s) + Fraction(1, 2)) for v in (a.low, a.high))
            return Raw(make("q_shift", (a.node,), (min(s, 62),)), e, low, high)
        if a.size << -s <= LIMIT:
            self.c.tally.proved += 1
            return Raw(make("mul", (a.node, constant(1 << -s))), e, a.low << -s, a.high << -s)
        self.c.tally.guarded += 1
        return Raw(make("q_shift", (a.node,), (max(s, -62),)), e)

    def _value(self, node: Node, e: int | None) -> Raw:
        c = self.c
        match node.op:
            case "const":
                return self.literal(node.data, e)
            case "variable":
                if node.data in c.inverses:
                    return self.inverse(node, e)
                return c.locals[node.data]
            case "field":
                cell = number_of(c.function, node.data)
                return self.cell(node, cell, self.outside(node.data))
            case "element":
                array = array_of(c.function, node.data)
                place = make(node.op, (self.index(node.args[0]),), node.data)
                cell = c.arrays.element(array, affine(node.args[0])[0])
                if node.data == "kf.mu":
                    return self.probability(place)
                raw = self.cell(place, cell, plain(node.data) in ("kf.x", "x", "P", "S"))
                return replace(raw, low=0) if is_variance(node.data, node.args[0]) else raw
            case "read":
                if not node.args:
                    return self.cell(node, ("variable", c.function.name, node.data), False)
                cell = c.arrays.element(array_of(c.function, node.data), affine(node.args[0])[0])
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

    def outside(self, path: str) -> bool:
        """Whether a field is written by the user, and may hold any integer."""
        return not path.startswith("kf.") or path.startswith(("kf.parameters.", "kf.nis", "kf.log_likelihood"))

    def cell(self, node: Node, cell: tuple[object, ...], outside: bool) -> Raw:
        e = self.c.formats.of(cell)
        low, high = (LEAST, LIMIT) if outside else (-INSIDE, INSIDE)
        return Raw(node, -self.c.formats.bits if e is None else e, low, high)

    def probability(self, node: Node) -> Raw:
        """One that the user may have set: brought between 0 and 1."""
        one = 1 << self.c.formats.bits
        node = make("q_min", (make("q_max", (node, constant(0))), constant(one)))
        return Raw(node, -self.c.formats.bits, 0, one)

    def literal(self, value: Fraction, e: int | None) -> Raw:
        if value == 0:
            return Raw(constant(0), e or 0, 0, 0)
        if e is None:
            e = size_of(value) - BITS + 1
            while (value / power(e)).denominator == 1 and (value / power(e + 1)).denominator == 1:
                e += 1  # exact with fewer digits
        raw = max(-LIMIT, min(LIMIT, nearest(value, e)))
        return Raw(constant(raw), e, raw, raw)

    def lookup(self, node: Node) -> Raw:
        source: Constants = node.data
        found = self.c.lookups.get(source)
        if found is None:
            e = max((size_of(v) for v in source.numbers if v), default=0) - BITS + 1
            numbers = tuple(_rounded(v, e) for v in source.numbers)
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

    def negative(self, a: Raw) -> Raw:
        if a.node.constant is not None:
            return Raw(constant(-int(a.node.constant)), a.e, -a.high, -a.low)
        if a.node.op == "neg":
            return replace(a, node=a.node.args[0], low=-a.high, high=-a.low)
        if a.low < -LIMIT:
            self.c.tally.guarded += 1
            return Raw(make("q_sub", (constant(0), a.node)), a.e)
        return Raw(make("neg", (a.node,)), a.e, -a.high, -a.low)

    # sums of products ------------------------------------------------------------------------------------

    def terms(self, node: Node) -> list[tuple[int, tuple[Node, ...]]]:
        if node.op != "sum":
            return [(1, (node.args[0],)), (1 if node.op == "add" else -1, (node.args[1],))]
        out, position = [], 0
        for sign, count in node.data:
            out.append((sign, tuple(node.args[position : position + count])))
            position += count
        return out

    def sum(self, node: Node, e: int | None) -> Raw:
        terms = self.terms(node)
        needed = self.natural(node) if e is not None else self.useful(node, None)
        if needed is None:
            needed = e if e is not None else max(self._guess(f) for _, f in terms)
        least = needed - 2 if e is not None else needed  # a store's own head-room is enough
        plain = [(sign, f[0]) for sign, f in terms if len(f) == 1 and not _is_product(f[0])]
        if e is None:
            needed += any(self.value(f).e == needed + 1 for _, f in plain if f.constant is None)
        if e is None or e < least:
            e = self._sum_format(terms, plain, needed) if e is None else needed
        products = [(sign, f) for sign, f in terms if len(f) == 2 or _is_product(f[0])]
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

    def _guess(self, factors: tuple[Node, ...]) -> int:
        raws = [self.value(f) for f in factors]
        return raws[0].e if len(raws) == 1 else raws[0].e + raws[1].e + BITS

    def _sum_format(self, terms: list[tuple[int, tuple[Node, ...]]], plain: list[tuple[int, Node]], needed: int) -> int:
        """The natural format of a sum: no finer than its terms are, and a difference of what the user gives fits."""
        if len(plain) < len(terms):
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

    def _plus(self, total: Raw | None, sign: int, raw: Raw, e: int) -> Raw:
        if total is None:
            return raw if sign > 0 else self.negative(raw)
        if raw.node.constant == 0:
            return total
        if raw.node.constant is not None and raw.node.constant < 0:
            raw, sign = self.negative(raw), -sign
        low = total.low + (raw.low if sign > 0 else -raw.high)
        high = total.high + (raw.high if sign > 0 else -raw.low)
        op = "add" if sign > 0 else "sub"
        if low >= -LIMIT and high <= LIMIT:
            self.c.tally.proved += 1
            if total.node.op == "neg" and sign > 0:
                return Raw(make("sub", (raw.node, total.node.args[0])), e, low, high)
            return Raw(make(op, (total.node, raw.node)), e, low, high)
        self.c.tally.guarded += 1
        return Raw(make(f"q_{op}", (total.node, raw.node)), e, max(low, -LIMIT), min(high, LIMIT))

    def _madd(self, total: Raw | None, sign: int, factors: tuple[Node, ...], e: int) -> Raw:
        """total + sign times a product, at e."""
        if len(factors) == 1:
            factors = factors[0].args
        a, b = factors
        if b.constant is not None:
            a, b = b, a
        if self._inverse_of(a) or self._inverse_of(b) or _is_scaled(a, b):
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
                    self.c.tally.proved += 1
                    args = (begin.node, ra.node, rb.node)
                    clipped = make("q_mac", args, (s,)) if self.small(begin) else None
                    return Raw(make("q_fma", args, (s,)), e, begin.low + low, begin.high + high, clipped)
            self.c.tally.guarded += 1
            node = make("q_mac", (self.fit(total).node, ra.node, rb.node), (s,))
            return Raw(node, e, max(total.low + low, -INSIDE), min(total.high + high, INSIDE))
        return self._plus(total, 1, self._mul(ra, rb, s, e, most), e)

    def _within(self, a: Raw, b: Raw, s: int, most: int | None) -> tuple[Raw, Raw, int, int | None]:
        """Factors of which one has so few digits that s is at most LAST: it costs 1/8 of the product's LSB."""
        extra = s - LAST
        if extra <= 0 or not (self.small(a) and self.small(b)):
            return a, b, s, most
        most = None if most is None else (most >> extra) + (1 << BITS)
        if a.node.constant is None:
            return self.at(a, a.e + extra), b, LAST, most
        return a, self.at(b, b.e + extra), LAST, most

    def small(self, a: Raw) -> bool:
        return a.size <= INSIDE

    def fit(self, a: Raw) -> Raw:
        """Clipped to what is allowed inside."""
        if self.small(a):
            return a
        self.c.tally.guarded += 1
        if a.clipped is not None:
            return Raw(a.clipped, a.e, max(a.low, -INSIDE), min(a.high, INSIDE))
        return Raw(make("q_fit", (a.node,)), a.e, max(a.low, -INSIDE), min(a.high, INSIDE))

    def span(self, a: Raw, b: Raw, s: int, most: int | None) -> tuple[int, int]:
        """The interval of round(a b / 2^s); most: what is known of a b, which then is not negative."""
        if most is None:
            return _interval(a, b, s)
        return 0, (most + (1 << s >> 1)) >> s

    def _mul(self, a: Raw, b: Raw, s: int, e: int, most: int | None = None) -> Raw:
        a, b, s, most = self._within(a, b, s, most)
        low, high = self.span(a, b, s, most)
        args = (constant(0), a.node, b.node)
        if self.small(a) and self.small(b) and s >= FIRST and low >= -LIMIT and high <= LIMIT:
            self.c.tally.proved += 1
            return Raw(make("q_fma", args, (s,)), e, low, high, make("q_mac", args, (s,)))
        if self.small(a) and self.small(b) and FIRST <= s <= LAST:
            self.c.tally.guarded += 1
            return Raw(make("q_mac", args, (s,)), e, max(low, -INSIDE), min(high, INSIDE))
        self.c.tally.guarded += 1
        return Raw(make("q_mul", (a.node, b.node), (s,)), e, max(low, -LIMIT), min(high, LIMIT))

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

    def product(self, node: Node, e: int | None) -> Raw:
        a, b = node.args
        if b.constant is not None:
            a, b = b, a
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
        elif fine and not (self._inverse_of(a) or self._inverse_of(b)):
            if a.constant is None:  # what one LSB of either factor makes is below any use
                e = max(e, self.value(a).e + self.value(b).e + USEFUL)
            else:
                e = max(e, self.value(b).e + size_of(a.constant) - 4)
        return self._product(a, b, e)

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
                a, b = node.args
                if b.constant is not None:
                    a, b = b, a
                if self._inverse_of(a) or self._inverse_of(b):
                    return None
                if a.constant is not None:
                    inner = self.digits(b)
                    return None if inner is None or a.constant == 0 else inner + size_of(a.constant) - 4
                return self.value(a).e + self.value(b).e + USEFUL
            case "sum" | "add" | "sub":
                found = []
                for _, f in self.terms(node):
                    if f[0].constant is None or len(f) == 2:
                        found.append(self.digits(f[0] if len(f) == 1 else make("mul", f)))
                return None if not found or None in found else min(v for v in found if v is not None)
            case "variable" if node.data in self.c.inverses:
                return None
        return self.value(node).e

    def roomier(self, node: Node, e: int | None) -> int | None:
        """An exponent a little coarser at which a product is proved to fit, if there is one."""
        a, b = node.args
        natural = self.natural(node)
        if natural is None or self._inverse_of(a) or self._inverse_of(b):
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

    def _product(self, a: Node, b: Node, e: int) -> Raw:
        if self._inverse_of(a):
            a, b = b, a
        inverse = self._inverse_of(b)
        if inverse is not None:
            den, condition = inverse
            quotient = self._divided(self.value(a), den, e)
            if condition is None:
                return quotient
            return Raw(make("select", (condition, quotient.node, constant(0))), e, -LIMIT, LIMIT)
        if b.constant is not None:
            a, b = b, a
        if a.constant is not None and b.op == "mul" and not b.args[0].constant:
            pass
        ra, rb, s, most = self._factors(a, b, e)
        if ra is None or rb is None:
            return Raw(constant(0), e, 0, 0)
        if s == 0 and ra.node.constant == 1:
            return rb
        if not 0 <= s <= 62:
            return self._shifted_product(ra, rb, e)
        return self._mul(ra, rb, s, e, most)

    # what cannot be negative, and shares of a whole ------------------------------------------------------

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
                           for sign, f in self.terms(node))  # fmt: skip
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
            if any(sign > 0 and len(f) == 1 and same(f[0], part) for sign, f in self.terms(inner)):
                e = self.c.locals[whole.data].e
                if e <= raw.e and raw.size << (raw.e - e) <= INSIDE:  # neither rounded nor clipped when it was added
                    return (1 << max(-raw.e - over.e, 0)) + (1 << BITS)
        return None

    # quotients -------------------------------------------------------------------------------------------

    def _inverse_of(self, node: Node) -> tuple[Raw, Node | None] | None:
        if node.op == "div" and node.args[0].constant == 1 and self.c.formats.more:
            den = self.value(node.args[1])
            return (den, None) if den.low <= 0 else None
        return self.c.inverses.get(node.data) if node.op == "variable" else None

    def inverse(self, node: Node, e: int | None) -> Raw:
        """A reciprocal that is not kept, used by itself."""
        den, condition = self.c.inverses[node.data]
        if e is None:
            e = self.c.formats.node(self.c.known[f"1/{node.data}"]) or -den.e - BITS
        one = self._divided(Raw(constant(1), 0, 1, 1), den, e)
        if condition is None:
            return one
        return Raw(make("select", (condition, one.node, constant(0))), e, -LIMIT, LIMIT)

    def quotient(self, node: Node, e: int | None) -> Raw:
        fine = e is None
        if e is None:
            e = self.natural(node)
        a, b = node.args
        den = self.value(b)
        if fine and e is not None and a.constant is None:
            e = max(e, self.value(a).e - den.e - BITS - 3)
        if e is None:
            e = (0 if a.constant is not None else self.value(a).e) - den.e - BITS // 2
        return self._divided(self.value(a), den, e)

    def _divided(self, a: Raw, b: Raw, e: int) -> Raw:
        """a / b at e."""
        s = a.e - b.e - e
        self.c.tally.guarded += 1
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

    # functions -------------------------------------------------------------------------------------------

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
                half = nearest(node.data / 2, a.e - 32)
                if -half < a.low << 32 and a.high << 32 <= half:
                    return a  # no number of that unit comes round
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
            self.c.tally.guarded += 1
            return Raw(make(f"q_{op}", (a.node,), (-a.e, -out)), out)
        if op == "atan2":
            a, b = self.together(node.args)
        else:
            a, b = (self._placed(self.value(n)) for n in node.args)
        out = min(max(e, -30), 0)
        self.c.tally.guarded += 1
        if op == "atan2":
            out = max(out, -29)
            return Raw(make("q_atan2", (a.node, b.node), (-out,)), out)
        if op == "pow":
            return Raw(make("q_pow", (a.node, b.node), (-a.e, -b.e, -out)), out)
        raise NotImplementedError(op)

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

    def root(self, node: Node, e: int | None) -> Raw:
        squares = self._squares(node.args[0])
        if squares is not None:
            raws = self.together(squares)
            total, shared = raws[0], raws[0].e
            for r in raws[1:]:
                self.c.tally.guarded += 1
                total = Raw(make("q_hypot", (total.node, r.node)), shared, 0, LIMIT)
            return total
        a = self.value(node.args[0])
        if e is None:
            e = (a.e - BITS) // 2 + 1
        s = a.e - 2 * e
        if s > 62:
            e += (s - 61) // 2
        elif s < -62:
            e -= (-s - 61) // 2
        self.c.tally.guarded += 1
        return Raw(make("q_sqrt", (a.node,), (a.e - 2 * e,)), e, 0, LIMIT)

    def _squares(self, node: Node) -> list[Node] | None:
        """The terms of a sum of squares: its root is a hypot, which needs no square."""
        if node.op != "sum":
            return None
        found = []
        for sign, factors in self.terms(node):
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


def _interval(a: Raw, b: Raw, s: int) -> tuple[int, int]:
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


def _is_product(node: Node) -> bool:
    return node.op == "mul"


def _is_scaled(a: Node, b: Node) -> bool:
    return False


def same(a: Node, b: Node) -> bool:
    """Whether two expressions are one by their text."""
    if a is b:
        return True
    return (
        a.op == b.op and a.data == b.data and len(a.args) == len(b.args)
        and a.op not in ("read",) and all(same(x, y) for x, y in zip(a.args, b.args, strict=True))
    )  # fmt: skip


_ = integer
