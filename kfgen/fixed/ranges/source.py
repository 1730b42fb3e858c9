"""Python source of functions on floats: their statements, and what is stored."""

from __future__ import annotations

from kfgen.fixed.program.cells import Arrays, number_of
from kfgen.fixed.ranges.expressions import ExpressionSource
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.scope import Scope
from kfgen.ir.nodes import Node
from kfgen.ir.program import (
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
)  # fmt: skip


def unguarded(node: Node) -> Node:
    """What a choice takes where its condition holds, if it takes 0 otherwise."""
    while node.op == "select" and node.args[2].constant == 0:
        node = node.args[1]
    return node


class Source(ExpressionSource):
    """Writes one function; a subclass may say otherwise how numbers are computed."""

    def __init__(self, function: Function, arrays: Arrays, ranges: Ranges, scope: Scope) -> None:
        super().__init__(function, arrays, ranges, scope)
        self.inverses: set[str] = set()  # locals that are 1/x

    def text(self) -> str:
        if self.f.private:
            args = []
            for a in self.f.arguments:
                args += [f"a_{a.name}", f"o_{a.name}"] if a.size is not None else [f"n_{a.name}"]
            self.lines.append(f"def f_{self.f.name}(A, N, {', '.join(args)}):")
        else:
            self.lines.append(f"def f_{self.f.name}(A, N):")
        self.block(self.f.body)
        self.emit("return 'OK'")
        return "\n".join(self.lines) + "\n"

    def block(self, body: list[Statement]) -> None:
        for s in body:
            self.statement(s)

    def nested(self, head: str, body: list[Statement]) -> None:
        self.emit(head)
        self.depth += 1
        self.block(body)
        self.emit("pass")
        self.depth -= 1

    def statement(self, s: Statement) -> None:
        match s:
            case Section():
                return
            case Let(node=node, name=name):
                self.emit(f"l_{name} = {self.value(node)}")
                self.quotient(node, name)
            case Declare(name=name, size=size, value=value):
                self.local.add(name)
                if size is not None:
                    self.emit(f"l_{name} = [0.0] * {size}")
                elif value is not None:
                    v = self.value(value)
                    self.emit(f"l_{name} = {v}")
                    if value.kind == "real":
                        self.record(("variable", self.f.name, name), f"l_{name}")
            case Assign(name=name, index=None, node=node):
                self.emit(f"l_{name} = {self.value(node)}")
                if node.kind == "real":
                    self.record(("variable", self.f.name, name), f"l_{name}")
            case Assign() | Store():
                self.store(s)
            case Guard(condition=condition, status=status, before=before):
                c = self.value(condition)
                self.emit(f"if {c}:")
                self.depth += 1
                for inner in before:
                    self.store(inner)
                self.emit(f"return {status!r}")
                self.depth -= 1
            case Flag(condition=condition):
                self.value(condition)
            case If(condition=condition, body=body):
                self.nested(f"if {self.value(condition)}:", body)
            case For(variable=v, start=start, stop=stop, body=body, down=down):
                a, b = self.value(start), self.value(stop)
                span = f"range({b} - 1, {a} - 1, -1)" if down else f"range({a}, {b})"
                self.nested(f"for c_{v} in {span}:", body)
            case Call():
                self.call(s)

    def quotient(self, node: Node, name: str) -> None:
        """Keep the values of a local that is a quotient."""
        node = unguarded(node)
        if node.op == "div" and node.args[0].constant is not None:
            self.inverses.add(name)
        elif node.op == "div" or (node.op == "mul" and any(a.data in self.inverses for a in node.args)):
            values = self.ranges.quotients.setdefault((self.f.name, name), [])
            self.emit(f"{self.scope.bound(values)}.append(l_{name})")

    def call(self, s: Call) -> None:
        args = []
        for argument, given in zip(s.callee.arguments, s.args, strict=True):
            if isinstance(given, Slice):
                array, offset = self.array(given.array)
                args += [array, f"{offset} + {self.value(given.offset)}" if offset else self.value(given.offset)]
            elif isinstance(given, Node):
                v = self.value(given)
                self.record(number_of(s.callee, argument.name), v)
                args.append(v)
            else:
                args.append("None")
        self.emit(f"f_{s.callee.name}({', '.join(['A', 'N', *args])})")

    def store(self, s: Assign | Store) -> None:
        v = self.value(s.node)
        if s.index is None:
            self.emit(f"N[{s.name!r}] = {v}")
            if s.node.kind == "real":
                self.record(number_of(self.f, s.name), v)
            return
        self.emit(f"{self.place(s.name, s.index)} = {v}")
        if s.node.kind == "real":
            v = self.new(v) if not v.isidentifier() else v
            self.record(self.arrays.named(self.f, s.name, s.index), v, small=s.name == "P")
