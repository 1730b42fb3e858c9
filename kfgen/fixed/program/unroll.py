"""Loops over fields of the struct, written out: each element of a covariance has a binary point of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from kfgen.fixed.program.nodes import fold, integer, make, nodes_of
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
    walk,
)  # fmt: skip


def unrolled(function: Function, tables: Mapping[str, tuple[int, ...]]) -> Function:
    """The function without the loops whose counters index fields or arguments. tables: constants of indices."""
    if function.private or not any(_touches(s) for s in walk(function.body) if isinstance(s, For)):
        return function
    return replace(function, body=_Unroller(tables).block(function.body, {}))


def _touches(loop: For) -> bool:
    """Whether a loop indexes arrays that are not its function's own by a counter."""
    inside = list(walk(loop.body))
    if any(isinstance(s, Store) and s.index is not None and s.index.constant is None for s in inside):
        return True
    local = {s.name for s in inside if isinstance(s, Declare)}
    return any(
        node.op == "element" and node.kind == "real" and node.data not in local and node.args[0].constant is None
        for node in nodes_of(loop.body)
    )


class _Unroller:
    def __init__(self, tables: Mapping[str, tuple[int, ...]]) -> None:
        self.tables = tables
        self.copies = 0
        self.known: dict[str, Node] = {}

    def block(self, body: list[Statement], values: dict[str, int], names: dict[str, str] | None = None
              ) -> list[Statement]:  # fmt: skip
        """values: of the counters; names: of the locals of loops in this copy."""
        out: list[Statement] = []
        names = {} if names is None else names
        for s in body:
            out += self.statement(s, values, names)
        return out

    def statement(self, s: Statement, values: dict[str, int], names: dict[str, str]) -> list[Statement]:
        def node(n: Node) -> Node:
            return self.node(n, values, names)

        match s:
            case For(variable=variable, start=start, stop=stop, body=body, down=down):
                first, last = node(start).constant, node(stop).constant
                counters = range(_known(first), _known(last))
                out: list[Statement] = []
                for i in reversed(counters) if down else counters:
                    self.copies += 1
                    inner = dict(names)
                    for d in walk(body):
                        if isinstance(d, Let | Declare) and (isinstance(d, Let) or d.size is None):
                            inner[d.name] = f"{d.name}_{self.copies}"
                    out += self.block(body, {**values, variable: i}, inner)
                return out
            case If(condition=condition, body=body):
                known = node(condition)
                if known.constant is not None:
                    return self.block(body, values, names) if known.constant else []
                return [If(known, self.block(body, values, names))]
            case Let():
                value, name = node(s.node), names.get(s.name, s.name)
                if value.constant is not None and value.kind != "real":
                    self.known[name] = value
                    return []
                return [Let(value, name)]
            case Declare():
                return [replace(s, name=names.get(s.name, s.name), value=None if s.value is None else node(s.value))]
            case Assign():
                return [Assign(names.get(s.name, s.name), None if s.index is None else node(s.index), node(s.node))]
            case Store():
                return [Store(s.name, None if s.index is None else node(s.index), node(s.node))]
            case Guard():
                condition = node(s.condition)
                before = [Store(b.name, None if b.index is None else node(b.index), node(b.node)) for b in s.before]
                return [] if condition.constant == 0 else [replace(s, condition=condition, before=before)]
            case Flag():
                condition = node(s.condition)
                return [] if condition.constant == 0 else [replace(s, condition=condition)]
            case Call():
                args = [replace(a, offset=node(a.offset)) if isinstance(a, Slice) else node(a) if isinstance(a, Node)
                        else a for a in s.args]  # fmt: skip
                return [replace(s, args=args)]
            case Section():
                return [s] if not values else []

    def node(self, n: Node, values: dict[str, int], names: dict[str, str]) -> Node:
        if n.op == "counter" and n.data in values:
            return integer(values[n.data])
        if n.op == "variable" or (n.op == "read" and not n.args):
            name = names.get(n.data, n.data)
            return self.known[name] if name in self.known else make(n.op, (), name, n.kind)
        if not n.args:
            return n
        args = tuple(self.node(a, values, names) for a in n.args)
        folded = fold(n.op, args, n.kind)
        if folded is not None:
            return folded
        if n.op == "element" and n.kind == "int" and args[0].constant is not None:
            for name, table in self.tables.items():
                if n.data.endswith(f"_{name}"):
                    return integer(table[int(args[0].constant)])
        return make(n.op, args, n.data, n.kind)


def _known(value: Fraction | None) -> int:
    assert value is not None, "a loop over fields has a fixed length"
    return int(value)
