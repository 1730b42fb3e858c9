"""Run a scheduled program on numbers of a scalar type: what the printed C must give, bit for bit.

The arithmetic is the scalar's own (`Scalar.evaluate`); this module only walks statements.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

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
from kfgen.ir.trace import RAISED
from kfgen.scalars.base import Scalar


@dataclass
class Memory:
    """What a function is given: `kf.x` -> list, `u.gyro` -> number. Stores change it."""

    arrays: dict[str, list[Any]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)


_READ = {"const", "field", "element", "read", "real", "lookup", "bit", "present", "half", "select", "and", "or"}


class _Return(Exception):  # noqa: N818 - it is control flow, not an error
    def __init__(self, status: str) -> None:
        self.status = status


def run(function: Function, scalar: Scalar, memory: Memory) -> set[str]:
    """Execute a function; returns the names of the status flags (empty: OK)."""
    machine = _Machine(scalar, memory)
    try:
        with scalar.quiet():
            machine.block(function.body)
    except _Return as result:
        if result.status == RAISED:
            return machine.flags
        return {result.status} - {"OK"}  # an error comes alone, and so does a refusal: nothing has been done
    return machine.flags


class _Machine:
    def __init__(self, scalar: Scalar, memory: Memory) -> None:
        self.scalar = scalar
        self.memory = memory
        self.locals: dict[str, Any] = {}
        self.counters: dict[Node, int] = {}
        self.flags: set[str] = set()

    def block(self, body: list[Statement]) -> None:
        for statement in body:
            self.statement(statement)

    def statement(self, statement: Statement) -> None:
        match statement:
            case Section():
                return
            case Let(node=node, name=name):
                self.locals[name] = self.value(node)
            case Declare(name=name, size=size, value=start):
                self.locals[name] = [None] * (size or 0) if start is None else self.value(start)
            case Assign(name=name, index=index, node=node):
                if index is None:
                    self.locals[name] = self.value(node)
                else:
                    self.locals[name][self.value(index)] = self.value(node)
            case Store():
                self.store(statement)
            case Guard(condition=condition, status=status, before=before):
                if self.value(condition):
                    for store in before:
                        self.store(store)
                    raise _Return(status)
            case Flag(condition=condition, flag=flag):
                if self.value(condition):
                    self.flags.add(flag)
            case Call():
                self.call(statement)
            case For():
                self.loop(statement)
            case If(condition=condition, body=body):
                if self.value(condition):
                    self.block(body)

    def call(self, call: Call) -> None:
        memory = Memory(dict(self.memory.arrays), dict(self.memory.numbers))
        parts: list[tuple[str, list[Any], int]] = []
        for argument, given in zip(call.callee.arguments, call.args, strict=True):
            if isinstance(given, Slice):
                whole = self.locals[given.array] if given.array in self.locals else self.memory.arrays[given.array]
                start = self.value(given.offset)
                assert argument.size is not None
                memory.arrays[argument.name] = whole[start : start + argument.size]
                if not argument.constant:
                    parts.append((argument.name, whole, start))
            elif isinstance(given, Node):  # `kf`, `u`, `flags` are at hand
                memory.numbers[argument.name] = self.value(given)
        machine = _Machine(self.scalar, memory)
        machine.block(call.callee.body)
        self.flags |= machine.flags
        for name, whole, start in parts:
            result = memory.arrays[name]
            whole[start : start + len(result)] = result

    def loop(self, statement: For) -> None:
        start, stop = self.value(statement.start), self.value(statement.stop)
        counters = range(start, stop)
        for i in reversed(counters) if statement.down else counters:
            self.locals[statement.variable] = i
            self.block(statement.body)

    def store(self, store: Store) -> None:
        value = self.value(store.node)
        if store.index is None:
            self.memory.numbers[store.name] = value
        else:
            self.memory.arrays[store.name][self.value(store.index)] = value

    def value(self, node: Node) -> Any:
        op = node.op
        if op == "variable" or op == "counter":
            return self.locals[node.data]
        if op in _READ:
            return self.read(node)
        args = [self.value(a) for a in node.args]
        if node.kind == "int" and op in ("add", "sub", "mul"):
            a, b = args
            return a + b if op == "add" else a - b if op == "sub" else a * b
        if op in ("lt", "le") and node.args[0].kind == "int":
            return args[0] < args[1] if op == "lt" else args[0] <= args[1]
        return self.scalar.evaluate(op, node.data, args)

    def read(self, node: Node) -> Any:
        """What is no operation on all arguments."""
        match node.op:
            case "const":
                return self.constant(node)
            case "field":
                return self.memory.numbers[node.data]
            case "element":
                return self.memory.arrays[node.data][self.value(node.args[0])]
            case "read":
                found = self.locals[node.data]
                return found[self.value(node.args[0])] if node.args else found
            case "real":
                return self.scalar.convert(self.value(node.args[0]))
            case "lookup":
                return self.scalar.convert(node.data.numbers[self.value(node.args[0])])
            case "bit":
                path, place = node.data
                return bool(self.memory.numbers[path] >> place & 1)
            case "present":  # all arguments are at hand
                return True
            case "half":
                return self.value(node.args[0]) // 2
            case "select":  # as C's ?: only the chosen branch is evaluated
                return self.value(node.args[1] if self.value(node.args[0]) else node.args[2])
            case "and":
                return self.value(node.args[0]) and self.value(node.args[1])
            case "or":
                return self.value(node.args[0]) or self.value(node.args[1])
        raise KeyError(node.op)

    def constant(self, node: Node) -> Any:
        value: Fraction = node.data
        if node.kind == "int":
            return int(value)
        if node.kind == "bool":
            return bool(value)
        return self.scalar.convert(value)
