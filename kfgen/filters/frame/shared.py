"""Private functions of several filters: those that are equal are emitted once."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

from kfgen.ir.nodes import Node
from kfgen.ir.program import Function


def shared(groups: list[tuple[str, list[Function]]]) -> list[Function]:
    """The functions to emit, callees first. groups: (mode, its private functions in the order of their calls).

    Functions that do the same get the same name; a name that several modes have for different things is followed by
    that of the first mode that means this one, and by a number where that is taken.
    """
    versions: dict[str, dict[Any, list[tuple[str, Function]]]] = {}
    order: list[Function] = []
    known: dict[int, Any] = {}
    for mode, functions in groups:
        for function in functions:
            key = _Key(known).of(function)
            known[id(function)] = key
            users = versions.setdefault(function.name, {}).setdefault(key, [])
            if not users:
                order.append(function)
            users.append((mode, function))
    taken = set(versions)
    for name, found in versions.items():
        if len(found) == 1:
            continue
        for users in found.values():
            own = unused(f"{name}_{users[0][0]}", taken)
            taken.add(own)
            for _, function in users:
                function.name = own
    return order


def unused(name: str, taken: set[str]) -> str:
    """The name, or the first of name_2, name_3, ... that is not taken."""
    found, count = name, 1
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    return found


class _Key:
    """What a function does, as nested tuples that compare. known: keys of functions met before, by identity."""

    def __init__(self, known: dict[int, Any]) -> None:
        self.known = known
        self.numbers: dict[int, int] = {}
        self.nodes: list[Any] = []

    def of(self, function: Function) -> Any:
        body = tuple(self._value(s) for s in function.body)
        arguments = tuple((a.name, a.type, a.pointer, a.constant, a.size) for a in function.arguments)
        return (function.name, arguments, body, tuple(self.nodes))

    def _value(self, value: Any) -> Any:
        if isinstance(value, Node):
            return ("node", self._node(value))
        if isinstance(value, Function):
            return ("function", self.known.get(id(value), id(value)))
        if isinstance(value, list | tuple):
            return tuple(self._value(v) for v in value)
        if is_dataclass(value) and not isinstance(value, type):
            return (type(value).__name__, *(self._value(getattr(value, f.name)) for f in fields(value)))
        return value

    def _node(self, node: Node) -> int:
        """A number for a node: that of its place among those met so far."""
        found = self.numbers.get(id(node))
        if found is None:
            key = (node.op, tuple(self._node(a) for a in node.args), node.data, node.kind)
            found = self.numbers[id(node)] = len(self.nodes)
            self.nodes.append(key)
        return found
