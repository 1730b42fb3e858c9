"""The statements of a function of real numbers, in integers."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from kfgen.fixed.arithmetic.limits import FINE, INSIDE
from kfgen.fixed.lowering.carry import Carry
from kfgen.fixed.lowering.deferred import Deferred
from kfgen.fixed.lowering.expressions import Expressions
from kfgen.fixed.lowering.plan import Plan
from kfgen.fixed.lowering.raw import Context, Raw
from kfgen.fixed.lowering.tidy import alive, tidied
from kfgen.fixed.lowering.values import between
from kfgen.fixed.program.cells import Cell, affine, is_variance, number_of, plain
from kfgen.fixed.program.nodes import constant, make
from kfgen.ir.nodes import Node
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

Stored = TypeVar("Stored", Store, Assign)
STATUS = Argument("flags", "{name}_status_t", pointer=True, constant=False)


class Statements:
    """Lowers one function. done: those that it may call, lowered."""

    def __init__(self, context: Context, done: dict[str, Function]) -> None:
        self.c = context
        self.f = context.function
        self.x = Expressions(context)
        self.carry = Carry(context, self.x)
        self.deferred = Deferred(context, self.x)
        self.done = done
        self.ties: dict[str, Cell] = {}

    def function(self) -> Function:
        self._ties()
        Plan(self.c, self.x, self.ties, self.exponent, self.target).run(self.f.body)
        self.carry.find(self.f)
        body = tidied(alive(self.block(self.f.body)))
        arguments = self.f.arguments
        if self.f.private:
            arguments = [*arguments, STATUS]
        told = not self.f.private and self.f.name.startswith("get_")  # what a getter writes may not fit: it says so
        return replace(self.f, body=body, arguments=arguments, returns="status" if told else self.f.returns)

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
        return self.c.arrays.named(self.f, s.name, s.index)

    def exponent(self, cell: Cell) -> int:
        e = self.c.formats.of(cell)
        return -self.c.formats.bits if e is None else e

    def block(self, body: list[Statement]) -> list[Statement]:
        out: list[Statement] = []
        for s in body:
            out += self.statement(s)
        return tidied(out)

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
                made = replace(s, value=self.x.value(value, e).node, point=e)
                return [made, *self.clipped(value, make("read", (), name))]
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
                return [replace(s, condition=test, before=[self.store(b) for b in before])]
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
        out = self.deferred.inverse(s)
        if out is None and name not in self.ties:
            out = self.deferred.ratio(s)
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
        return [Let(raw.node, name, raw.e), *self.clipped(node, make("variable", (), name))]

    def clipped(self, node: Node, value: Node) -> list[Statement]:
        """What is said of an adapted noise that its format has clipped, however long ago."""
        if node.op != "element" or not self.f.name.startswith(("get_R", "get_Q")):
            return []
        end = INSIDE - 1
        ends = ((constant(end), value), (value, constant(-end)))
        return [Flag(make("lt", pair, None, "bool"), "SATURATED") for pair in ends]

    def outside(self, name: str) -> bool:
        """Whether a local is stored where the user sees it, with all 31 bits."""
        return name in self.ties and self._is_outside(self.ties[name])

    def _is_outside(self, cell: Cell) -> bool:
        if plain(str(cell[1])) in ("kf.x", "kf.nis", "kf.log_likelihood"):
            return True
        return cell[0] == "array" and cell[2] in ("P", "S", "Q", "R") and not self.f.private

    def store(self, s: Stored) -> Stored:
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
        return [Let(made, name, -FINE), Store(s.name, index, word), Store("kf.rest", index, rest)]

    def carried(self, s: Store, cell: Cell) -> list[Statement]:
        """A store with its rest."""
        stored = self.store(s)
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
