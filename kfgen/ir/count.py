"""Arithmetic operations of a scheduled program."""

from __future__ import annotations

from collections import Counter

from kfgen.ir.nodes import Node
from kfgen.ir.program import Call, For, If, Statement, roots

_FREE = {"const", "field", "element", "read", "variable", "counter", "real", "neg", "half", "finite", "bit", "lookup",
         "q_count", "q_fit", "table_x", "table_y", "table_slope"}
_NAMES = {"lt": "compare", "le": "compare", "q_reciprocal": "div"}
_SILENT = {"and", "or", "not", "signs", "some"}


def operations(body: list[Statement]) -> dict[str, int] | None:
    """Operation -> how often one call executes it, in a fixed order; None where that depends on the run.

    A sum of k terms is k - 1 add; its products are mul. What is rare does not count, but for its condition.
    """
    counts: Counter[str] = Counter()
    if not _tally(body, 1, counts):
        return None
    first = ["mul", "add", "div", "sqrt"]
    order = first + sorted(k for k in counts if k not in first)
    return {op: counts[op] for op in order if counts[op]}


def _tally(body: list[Statement], times: int, counts: Counter[str]) -> bool:
    """Add what `times` executions of the statements take; False where a loop has no fixed length."""
    for statement in body:
        if isinstance(statement, If) and not statement.rare:
            return False
        if isinstance(statement, For):
            start, stop = statement.start.constant, statement.stop.constant
            if start is None or stop is None or not _tally(statement.body, times * int(stop - start), counts):
                return False
            continue
        if isinstance(statement, Call) and not _tally(statement.callee.body, times, counts):
            return False
        once: Counter[str] = Counter()
        for root in roots(statement):
            _count(root, once)
        for op, count in once.items():
            counts[op] += count * times
    return True


def _count(node: Node, counts: Counter[str]) -> None:
    if node.kind != "int":
        if node.op == "sum":
            counts["add"] += len(node.data) - 1
            counts["mul"] += sum(1 for _, factors in node.data if factors == 2)
        elif node.op in ("add", "sub", "q_add", "q_sub"):
            counts["add"] += 1
        elif node.op in ("q_madd", "q_fma", "q_mac"):
            counts["add"] += 1
            counts["mul"] += 1
        elif node.op not in _FREE and node.op not in _SILENT:
            counts[_NAMES.get(node.op, node.op.removeprefix("q_"))] += 1
    for argument in node.args:
        _count(argument, counts)
