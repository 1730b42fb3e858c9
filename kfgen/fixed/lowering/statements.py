"""The statements of a real program, in integers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import cast

from kfgen.filters.base import Block, FilterCode
from kfgen.fixed.arithmetic.scalar import FINE
from kfgen.fixed.formats.choose import Formats
from kfgen.fixed.lowering.carry import Carry
from kfgen.fixed.lowering.expressions import Expressions
from kfgen.fixed.lowering.plan import Plan, variables
from kfgen.fixed.lowering.raw import DYNAMIC, LIMIT, SPREAD, Context, QTable, Raw, constant, is_variance, nearest
from kfgen.fixed.lowering.values import between
from kfgen.fixed.program.cells import Cell, affine, array_of, number_of, plain
from kfgen.fixed.program.unroll import make
from kfgen.ir.nodes import Constants, Node, Table
from kfgen.ir.program import (
    Argument,
    Assign,
    Call,
    Declare,
    Flag,
    For,
    Function,
    Guard,
    If,
    Let,
    Section,
    Slice,
    Statement,
    Store,
    walk,
)  # fmt: skip

PROBABILITY = "what mu has below its LSB"
REST = "what x and the variances have below their LSB, by 2^-16 of it"
STATUS = Argument("flags", "{name}_status_t", pointer=True, constant=False)


def lower(code: FilterCode, formats: Formats) -> FilterCode:
    """The filter in integers."""
    tables: dict[Table, QTable] = {}
    lookups: dict[Constants, tuple[Constants, int]] = {}
    done: dict[str, Function] = {}
    for f in code.functions:
        context = Context(f, formats, formats.arrays, tables, lookups)
        done[f.name] = _Statements(context, done).function()
    blocks = []
    for block in code.blocks:
        initial = tuple(
            _raw(value, formats.of(formats.arrays.element(("array", f"kf.{block.name}"), i)), formats.bits)
            for i, value in enumerate(block.initial)
        )
        blocks.append(replace(block, initial=initial))
    if code.modes and formats.bits < FINE:
        blocks.append(Block("rest", len(code.modes), PROBABILITY, initial=tuple(_rests(code, formats))))
    if formats.carried:
        size = len(formats.carried)
        blocks.append(Block("rest", size, REST, initial=(Fraction(0),) * size))
    return replace(
        code, blocks=tuple(blocks), functions=tuple(done.values()),
        tables=cast(Mapping[Table, str], {tables[t]: name for t, name in code.tables.items() if t in tables}),
        lookups={lookups[c][0]: name for c, name in code.lookups.items() if c in lookups}, constants={},
    )  # fmt: skip


def _rests(code: FilterCode, formats: Formats) -> Iterator[Fraction]:
    """What mu0 has below its LSB."""
    (mu,) = (block for block in code.blocks if block.name == "mu")
    for value in mu.initial:
        yield _raw(value, -FINE, FINE) - (_raw(value, -formats.bits, formats.bits) * 2 ** (FINE - formats.bits))


def _raw(value: Fraction, e: int | None, bits: int) -> Fraction:
    return Fraction(max(-LIMIT, min(LIMIT, nearest(value, -bits if e is None else e))))


class _Statements:
    def __init__(self, context: Context, done: dict[str, Function]) -> None:
        self.c = context
        self.f = context.function
        self.x = Expressions(context)
        self.carry = Carry(context, self.x)
        self.done = done
        self.ties: dict[str, Cell] = {}

    def function(self) -> Function:
        self._ties()
        Plan(self.c, self.x, self.ties, self.exponent, self.target).run(self.f.body)
        self.carry.find(self.f)
        body = _tidied(alive(self.block(self.f.body)))
        arguments = self.f.arguments
        if self.f.private:
            arguments = [*arguments, STATUS]
        return replace(self.f, body=body, arguments=arguments)

    def _ties(self) -> None:
        """Locals that are stored as they are take the format of where they go; mu has more digits inside."""
        for s in walk(self.f.body):
            if not isinstance(s, Store | Assign) or s.name == "kf.mu":
                continue
            if s.node.op == "variable" and s.node.kind == "real":
                self.ties.setdefault(s.node.data, self.target(s))

    def target(self, s: Store | Assign) -> Cell:
        if s.index is None:
            if isinstance(s, Assign):
                return ("variable", self.f.name, s.name)
            return number_of(self.f, s.name)
        return self.c.arrays.element(array_of(self.f, s.name), affine(s.index)[0])

    def exponent(self, cell: Cell) -> int:
        e = self.c.formats.of(cell)
        return -self.c.formats.bits if e is None else e

    def block(self, body: list[Statement]) -> list[Statement]:
        out: list[Statement] = []
        for s in body:
            out += self.statement(s)
        return _tidied(out)

    def statement(self, s: Statement) -> list[Statement]:
        match s:
            case Section():
                return [s]
            case Let():
                return [*self.let(s), *self.carry.local(s)]
            case Declare(name=name, value=value):
                if value is None:
                    return [s]
                if value.kind != "real":
                    return [replace(s, value=self.x.index(value))]
                e = self.exponent(("variable", self.f.name, name))
                return [replace(s, value=self.x.value(value, e).node)]
            case Assign():
                return [self.store(s)]
            case Store() if s.name == "kf.mu" and self.c.formats.bits < FINE:
                return self.probability(s)
            case Store():
                cell = self.carry.cell_of(s)
                return [self.store(s)] if cell is None else self.carried(s, cell)
            case Guard(condition=condition, before=before):
                test = self.x.index(condition)
                if test.constant == 0:
                    return []
                return [replace(s, condition=test, before=[self.store(b) for b in before])]  # type: ignore[misc]
            case Flag(condition=condition):
                test = self.x.index(condition)
                return [] if test.constant == 0 else [replace(s, condition=test)]
            case If(condition=condition, body=body):
                test = self.x.index(condition)
                if test.constant is not None:
                    return self.block(body) if test.constant else []
                return [If(test, self.block(body))]
            case For(start=start, stop=stop, body=body):
                return [replace(s, start=self.x.index(start), stop=self.x.index(stop), body=self.block(body))]
            case Call():
                return [self.call(s)]

    def let(self, s: Let) -> list[Statement]:
        node, name = s.node, s.name
        if node.kind != "real":
            value = self.x.index(node)
            if value.constant is not None:
                self.c.known[name] = value
                return []
            return [Let(value, name)]
        for made in (self.inverse, self.ratio):
            out = made(s)
            if out is not None:
                return out
        if node.op in ("element", "field", "read", "variable"):
            raw = self.x.value(node)
        else:
            e = self.exponent(self.ties[name]) if name in self.ties else self.c.planned.get(name)
            if e is not None and name in self.ties:
                least = self.c.formats.node(node, 0)
                e = None if least is not None and least > e else e
            if name not in self.ties and (node.op == "mul" or (node.op == "sum" and e is not None)):
                e = self.x.useful(node, e)
            if name not in self.ties and node.op == "mul":
                e = self.x.roomier(node, e)
            raw = self.x.value(node, e)
            if not self.outside(name) and name not in self.c.unlimited:
                raw = self.x.fit(raw)
        if raw.node.constant is not None:
            self.c.locals[name] = raw
            return []
        self.c.locals[name] = replace(raw, node=make("variable", (), name))
        return [Let(raw.node, name)]

    def outside(self, name: str) -> bool:
        """Whether a local is stored where the user sees it, with all 31 bits."""
        return name in self.ties and self._is_outside(self.ties[name])

    def _is_outside(self, cell: Cell) -> bool:
        if plain(str(cell[1])) in ("kf.x", "kf.nis", "kf.log_likelihood"):
            return True
        return cell[0] == "array" and cell[2] in ("P", "S", "Q", "R") and not self.f.private

    def inverse(self, s: Let) -> list[Statement] | None:
        """A reciprocal whose size varies much is not kept: every quotient is divided."""
        node, condition = s.node, None
        if node.op == "select" and node.args[2].constant == 0:
            condition, node = node.args[0], node.args[1]
        if node.op != "div" or node.args[0].constant is None:
            return None
        ranges = self.c.formats.ranges
        largest, smallest = ranges.largest(node), ranges.smallest(node)
        if node.args[0].constant != 1:
            return None
        if self.c.formats.more:  # the runs may not have met the smallest divisor
            if self.x.value(node.args[1]).low > 0 and largest <= DYNAMIC * smallest:
                return None
        elif largest == 0 or largest <= DYNAMIC * smallest:
            return None
        out: list[Statement] = []
        test = self._tested(s.name, condition, out)
        self.c.inverses[s.name] = (self._simple(f"{s.name}_of", node.args[1], out), test)
        self.c.known[f"1/{s.name}"] = node
        return out

    def ratio(self, s: Let) -> list[Statement] | None:
        """A quotient that is far larger now and then than it usually is: it is made with each product that it is in."""
        if s.name in self.ties or self.c.formats.ranges.spread(self.f.name, s.name) <= SPREAD:
            return None
        node, condition = s.node, None
        if node.op == "select" and node.args[2].constant == 0:
            condition, node = node.args[0], node.args[1]
        out: list[Statement] = []
        if node.op == "div":
            num, den, test = node.args[0], self._simple(f"{s.name}_of", node.args[1], out), None
        elif node.op == "mul" and any(a.data in self.c.inverses for a in node.args):
            num, inverse = node.args if node.args[1].data in self.c.inverses else node.args[::-1]
            den, test = self.c.inverses[inverse.data]
        else:
            return None
        test = self._tested(s.name, condition, out) if test is None else test
        self.c.ratios[s.name] = (self._simple(f"{s.name}_by", num, out), den, test)
        return out

    def _tested(self, name: str, condition: Node | None, out: list[Statement]) -> Node | None:
        """A condition as a truth value that is kept."""
        test = None if condition is None else self.x.index(condition)
        if test is None or test.op == "variable":
            return test
        out.append(Let(test, f"{name}_some"))
        return make("variable", (), f"{name}_some", "bool")

    def _simple(self, name: str, node: Node, out: list[Statement]) -> Raw:
        """A value that is kept."""
        raw = self.x.value(node)
        if raw.node.op in ("variable", "element", "field"):
            return raw
        out.append(Let(raw.node, name))
        return replace(raw, node=make("variable", (), name))

    def store(self, s: Store | Assign) -> Store | Assign:
        index = None if s.index is None else self.x.index(s.index)
        if s.node.kind != "real":
            return replace(s, index=index, node=self.x.index(s.node))
        raw = self.x.value(s.node, self.exponent(self.target(s)))
        if not self._is_outside(self.target(s)):
            raw = self.x.fit(raw)
        node = raw.node
        if isinstance(s, Store) and raw.low < 0 and s.index is not None and is_variance(s.name, s.index):
            node = make("q_max", (node, constant(0)))
        return replace(s, index=index, node=node)

    def probability(self, s: Store) -> list[Statement]:
        """An element of mu and its rest."""
        assert s.index is not None
        index, k = self.x.index(s.index), FINE - self.c.formats.bits
        name = f"mu_{affine(s.index)[0]}_fine"
        fine = make("variable", (), name)
        word = make("q_shift", (fine,), (k,))
        rest = make("sub", (fine, make("mul", (word, constant(1 << k)))))
        made = between(self.x.value(s.node, -FINE).node, 1 << FINE)
        return [Let(made, name), Store(s.name, index, word), Store("kf.rest", index, rest)]

    def carried(self, s: Store, cell: Cell) -> list[Statement]:
        """A store with its rest."""
        stored = self.store(s)
        assert isinstance(stored, Store)
        kept = self.carry.kept(s, cell)
        if kept is None:
            return [stored, self.carry.cleared(cell)]
        lets, node, rest = kept
        raw = Raw(node, self.exponent(cell))
        if not self._is_outside(cell):
            raw = self.x.fit(raw)
        node = raw.node
        if s.index is not None and is_variance(s.name, s.index):
            node = make("q_max", (node, constant(0)))
        return [*lets, replace(stored, node=node), rest]

    def call(self, s: Call) -> Call:
        args: list[str | Slice | Node] = []
        for argument, given in zip(s.callee.arguments, s.args, strict=True):
            if isinstance(given, Slice):
                args.append(replace(given, offset=self.x.index(given.offset)))
            elif isinstance(given, Node):
                e = self.exponent(number_of(s.callee, argument.name))
                args.append(self.x.value(given, e).node)
            else:
                args.append(given)
        args.append("flags" if self.f.private else "&flags")
        return Call(self.done[s.callee.name], args)


def alive(body: list[Statement]) -> list[Statement]:
    """Without locals that nobody reads, as those of guards that have vanished."""
    while True:
        used = {name for s in walk(body) for name in variables(s)}
        kept, dropped = _without(body, used)
        if not dropped:
            return kept
        body = kept


def _without(body: list[Statement], used: set[str]) -> tuple[list[Statement], bool]:
    out: list[Statement] = []
    dropped = False
    for s in body:
        if isinstance(s, Let) and s.name not in used:
            dropped = True
            continue
        if isinstance(s, For | If):
            inner, gone = _without(s.body, used)
            dropped |= gone
            s = replace(s, body=inner)
        out.append(s)
    return out, dropped


def _tidied(body: list[Statement]) -> list[Statement]:
    """Without headings of nothing."""
    kept: list[Statement] = []
    for s in body:
        if isinstance(s, Section) and kept and isinstance(kept[-1], Section):
            kept.pop()
        kept.append(s)
    if kept and isinstance(kept[-1], Section):
        kept.pop()
    return kept
