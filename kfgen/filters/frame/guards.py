"""Guards: where a function ends with an error before it has changed anything."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import or_

from kfgen.filters.frame.runs import summed
from kfgen.filters.frame.shown import shown, shown_first
from kfgen.ir.nodes import Node
from kfgen.ir.program import Call, Guard, Statement, roots, walk
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model

GIVEN = ("u.", "kf.parameters.")
"""Paths of the numbers that a caller sets, and that a function may read or leave."""


def arguments(t: Trace) -> None:
    """Here the inputs and parameters that the function reads are tested; `settled` knows which."""
    t.arguments_at = len(t.block.items)


def settled(t: Trace, model: Model) -> None:
    """NOT_FINITE at `arguments`, now that the whole function is recorded: each input and parameter by itself, for the
    sum of large numbers would overflow. A parameter needs no test where a later one shows it, and no other status can
    come before."""
    assert t.arguments_at is not None, "a function that reads what it is given"
    read = _read(t)
    seen = {node.data for node in shown_first(t) if node.op == "field"}
    paths = [f"u.{name}" for name in model.inputs if f"u.{name}" in read]
    paths += [path for path in (f"kf.parameters.{name}" for name, _ in model.parameters) if path in read - seen]
    recorded = t.block.items
    t.block.items = []
    if paths:
        t.section("arguments")
    for path in paths:
        t.guard(~t.finite(t.field(path)), "NOT_FINITE")
    recorded[t.arguments_at : t.arguments_at] = t.block.items
    t.block.items = recorded


def finite(t: Trace, values: Iterable[Value], entering: Iterable[Value] = ()) -> None:
    """NOT_FINITE by one test for all: a sum is finite only if its terms are.

    entering: what has entered the estimate too, tested where the values do not show it: 1 / s is finite where s is not.
    """
    live = list({v.node: v for v in map(t.value, values) if v.constant is None}.values())
    seen = shown(v.node for v in live)
    for v in entering:
        if v.constant is None and v.node not in seen:
            live.append(v)
            seen |= shown([v.node])
    live = summed(t, live)
    if live:
        t.guard(~t.finite(sum(live[1:], live[0])), "NOT_FINITE")


def positive(t: Trace, failures: list[Value]) -> None:
    """NOT_POSITIVE where one of the conditions holds."""
    live = list({f.node: f for f in failures if f.constant != 0}.values())
    if live:
        t.guard(reduce(or_, live), "NOT_POSITIVE")


def doubts(t: Trace, values: list[Value]) -> None:
    """NOT_POSITIVE where a variance that had to be taken on trust is negative, after NOT_FINITE of the model."""
    if t.doubts:
        finite(t, values)
        for condition, why in t.doubts:
            t.guard(condition, "NOT_POSITIVE", why)
        t.doubts.clear()


def _read(t: Trace) -> set[str]:
    """Paths of the inputs and parameters that statements use, private functions included."""
    found: set[str] = set()
    seen: set[int] = set()

    def visit(statements: Iterable[Statement]) -> None:
        for statement in statements:
            if isinstance(statement, Call):
                visit(walk(statement.callee.body))
            stack: list[Node] = roots(statement)
            while stack:
                node = stack.pop()
                if id(node) not in seen:
                    seen.add(id(node))
                    if node.op == "field" and str(node.data).startswith(GIVEN):
                        found.add(node.data)
                    stack += node.args

    for block in (t.block, *t.blocks.values()):
        visit(item for item in block.items if not isinstance(item, Node))
    return found
