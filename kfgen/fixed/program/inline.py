"""Private functions that go through a field of the struct, written out where they are called.

An array that a function is given shares the binary points of all that it may be, and what a loop goes through has one:
an element of a covariance is to have one of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import count

from kfgen.fixed.program.nodes import make, nodes_of
from kfgen.ir.nodes import Node
from kfgen.ir.program import Assign, Call, Declare, For, Function, If, Let, Slice, Statement, Store, mapped, walk


def inlined(functions: Iterable[Function]) -> tuple[Function, ...]:
    """The functions without such calls, and without those that nobody calls any more."""
    made = [replace(f, body=_block(f.body, count(1))) for f in functions]
    called = {s.callee.name for f in made for s in walk(f.body) if isinstance(s, Call)}
    return tuple(f for f in made if not f.private or f.name in called)


def _block(body: list[Statement], calls: Iterator[int]) -> list[Statement]:
    """calls: numbers for the locals of what is written out, so that two calls of one function share none."""
    out: list[Statement] = []
    for s in body:
        if isinstance(s, For | If):
            out.append(replace(s, body=_block(s.body, calls)))
        elif isinstance(s, Call) and _goes_through(s):
            out += _block(_Inliner(s, next(calls)).block(s.callee.body), calls)
        else:
            out.append(s)
    return out


def _goes_through(s: Call) -> bool:
    """Whether a counter indexes a field that is given."""
    fields = {
        argument.name for argument, given in zip(s.callee.arguments, s.args, strict=True)
        if isinstance(given, Slice) and given.array.startswith("kf.")
    }  # fmt: skip
    return any(
        node.op == "element" and node.kind == "real" and node.data in fields and node.args[0].constant is None
        for node in nodes_of(s.callee.body)
    )


class _Inliner:
    """The body of a callee with what one call gives it."""

    def __init__(self, s: Call, number: int) -> None:
        pairs = list(zip(s.callee.arguments, s.args, strict=True))
        self.arrays: Mapping[str, Slice] = {a.name: g for a, g in pairs if isinstance(g, Slice)}
        self.numbers: Mapping[str, Node] = {a.name: g for a, g in pairs if isinstance(g, Node)}
        own = [each.name for each in walk(s.callee.body) if isinstance(each, Let | Declare)]
        self.names = {name: f"{s.callee.name}_{number}_{name}" for name in own}

    def block(self, body: list[Statement]) -> list[Statement]:
        return [self.statement(s) for s in body]

    def statement(self, s: Statement) -> Statement:
        s = mapped(s, self.node)
        match s:
            case Let(name=name) | Declare(name=name):
                return replace(s, name=self.names[name])
            case Assign(name=name):
                return replace(s, name=self.names.get(name, name))
            case Call(args=args):
                return replace(s, args=[self.part(a) if isinstance(a, Slice) else a for a in args])
            case Store(name=name, index=index) if name in self.arrays and index is not None:
                return replace(s, name=self.arrays[name].array, index=self.index(name, index))
            case For(body=body) | If(body=body):
                return replace(s, body=self.block(body))
            case _:
                return s

    def node(self, n: Node) -> Node:
        if n.op in ("variable", "read"):
            args = tuple(map(self.node, n.args))
            return make(n.op, args, self.names.get(n.data, n.data), n.kind)
        if n.op == "field" and n.data in self.numbers:
            return self.numbers[n.data]
        if n.op == "element" and n.data in self.arrays:
            place = self.index(n.data, self.node(n.args[0]))
            return make(n.op, (place,), self.arrays[n.data].array, n.kind)
        return make(n.op, tuple(map(self.node, n.args)), n.data, n.kind) if n.args else n

    def part(self, given: Slice) -> Slice:
        """A part of an array that the callee hands on: of its own, or of one that it was given."""
        if given.array in self.arrays:
            whole = self.arrays[given.array]
            return replace(given, array=whole.array, offset=self.index(given.array, given.offset))
        return replace(given, array=self.names.get(given.array, given.array))

    def index(self, name: str, place: Node) -> Node:
        offset = self.arrays[name].offset
        return place if offset.constant == 0 else make("add", (place, offset), None, "int")
