"""Arithmetic operations of a scheduled program."""

from __future__ import annotations

from collections import Counter

from kfgen.ir.nodes import Node
from kfgen.ir.program import For, If, Statement, roots

_FREE = {"const", "field", "element", "read", "variable", "counter", "real", "neg", "half", "finite"}
_NAMES = {"lt": "compare", "le": "compare"}
_SILENT = {"and", "or", "not"}


def operations(body: list[Statement]) -> dict[str, int] | None:
    """Operation -> how often one call executes it, in a fixed order; None where loops make it depend on the run.

    A sum of k terms is k - 1 add; its products are mul.
    """
    counts: Counter[str] = Counter()
    for statement in body:
        if isinstance(statement, For | If):
            return None
        for root in roots(statement):
            _count(root, counts)
    first = ["mul", "add", "div", "sqrt"]
    order = first + sorted(k for k in counts if k not in first)
    return {op: counts[op] for op in order if counts[op]}


def _count(node: Node, counts: Counter[str]) -> None:
    if node.kind != "int":
        if node.op == "sum":
            counts["add"] += len(node.data) - 1
            counts["mul"] += sum(1 for _, factors in node.data if factors == 2)
        elif node.op in ("add", "sub"):
            counts["add"] += 1
        elif node.op not in _FREE and node.op not in _SILENT:
            counts[_NAMES.get(node.op, node.op)] += 1
    for argument in node.args:
        _count(argument, counts)
