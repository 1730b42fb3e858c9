"""Nodes that no trace has made, and what is asked of any: its terms, what is below it, whether it is known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TypeVar

from kfgen.ir.nodes import Node
from kfgen.ir.program import Statement, roots, walk

T = TypeVar("T")


def make(op: str, args: tuple[Node, ...] = (), data: object = None, kind: str = "real") -> Node:
    return Node(op, args, data, kind, 0, False)


def integer(value: int) -> Node:
    return make("const", (), Fraction(value), "int")


def boolean(value: bool) -> Node:
    return make("const", (), Fraction(int(value)), "bool")


def constant(value: int) -> Node:
    """A real number that is whole: a constant of the integer program."""
    return make("const", (), Fraction(value))


def nodes_of(body: list[Statement]) -> Iterator[Node]:
    """All that the statements evaluate, each node once."""
    seen: set[int] = set()
    for statement in walk(body):
        stack = list(roots(statement))
        while stack:
            node = stack.pop()
            if id(node) not in seen:
                seen.add(id(node))
                yield node
                stack += node.args


def variables(s: Statement) -> Iterator[str]:
    """The names of the locals that a statement reads, as often as it does."""
    stack = list(roots(s))
    while stack:
        node = stack.pop()
        if node.op == "variable":
            yield node.data
        stack += node.args


def grouped(signs: Sequence[tuple[int, int]], factors: Sequence[T]) -> list[tuple[int, tuple[T, ...]]]:
    """The terms of a sum, (sign, factors): the data of its node says how many each takes of all the factors."""
    out, position = [], 0
    for sign, count in signs:
        out.append((sign, tuple(factors[position : position + count])))
        position += count
    return out


def terms(node: Node) -> list[tuple[int, tuple[Node, ...]]]:
    """Of a sum, or of a sum or difference of two: (sign, factors)."""
    if node.op != "sum":
        return [(1, (node.args[0],)), (1 if node.op == "add" else -1, (node.args[1],))]
    return grouped(node.data, node.args)


def same(a: Node, b: Node) -> bool:
    """Whether two expressions are one by their text."""
    if a is b:
        return True
    return (
        a.op == b.op and a.data == b.data and len(a.args) == len(b.args)
        and a.op not in ("read",) and all(same(x, y) for x, y in zip(a.args, b.args, strict=True))
    )  # fmt: skip


def fold(op: str, args: tuple[Node, ...], kind: str) -> Node | None:
    """Integers and truth values that are known."""
    known = [a.constant for a in args]
    if op == "select" and known[0] is not None:
        return args[1] if known[0] else args[2]
    if op in ("and", "or"):
        for i in (0, 1):
            if known[i] is not None:
                decides = bool(known[i]) == (op == "or")
                return boolean(op == "or") if decides else args[1 - i]
        return None
    if op == "not" and known[0] is not None:
        return boolean(not known[0])
    if any(v is None for v in known) or any(a.kind not in ("int", "bool") for a in args):
        return None
    a = int(known[0] or 0)
    if op == "half":
        return integer(a // 2)
    if op == "neg":
        return integer(-a)
    if len(known) != 2:
        return None
    b = int(known[1] or 0)
    match op:
        case "add":
            return integer(a + b)
        case "sub":
            return integer(a - b)
        case "mul":
            return integer(a * b)
        case "lt":
            return boolean(a < b)
        case "le":
            return boolean(a <= b)
    return None
