"""Guards: where a function ends with an error before it has changed anything."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import reduce
from operator import or_

from kfgen.filters.frame.runs import summed
from kfgen.filters.frame.shown import is_sure, shown, shown_first, unwrapped
from kfgen.ir.given import given
from kfgen.ir.nodes import BOOL, Node
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model


def arguments(t: Trace, needed: Mapping[str, Value] | None = None) -> None:
    """Here the inputs and parameters that the function reads are tested; `settled` knows which. needed: whether one
    counts, where it does not always, by its path."""
    t.arguments_at = len(t.block.items)
    t.needed = dict(needed or {})


def settled(t: Trace, model: Model) -> None:
    """NOT_FINITE at `arguments`, now that the whole function is recorded, what was left to the end included: each input
    and parameter by itself, for the sum of large numbers would overflow. A parameter needs no test where a later one
    shows it, and no other status can come before."""
    for closing in t.closings:
        closing()
    assert t.arguments_at is not None, "a function that reads what it is given"
    read = given(item for block in (t.block, *t.blocks.values()) for item in block.items if not isinstance(item, Node))
    seen = {node.data for node in shown_first(t) if node.op == "field"}
    paths = [f"u.{name}" for name in model.inputs if f"u.{name}" in read]
    paths += [path for path in (f"kf.parameters.{name}" for name, _ in model.parameters) if path in read - seen]
    recorded = t.block.items
    t.block.items = []
    if paths:
        t.section("arguments")
    for path in paths:
        test = t.pool.fresh("finite", (t.field(path).node,), None, BOOL)  # a later test may be the same
        test.volatile = False
        failed = ~t.wrapped(test)
        t.guard(t.needed[path] & failed if path in t.needed else failed, "NOT_FINITE")
    recorded[t.arguments_at : t.arguments_at] = t.block.items
    t.block.items = recorded


def finite(t: Trace, values: Iterable[Value], entering: Iterable[Value] = ()) -> None:
    """NOT_FINITE by one test for all: a sum is finite only if its terms are.

    entering: what has entered the estimate too, tested where the values do not show it: 1 / s is finite where s is not.
    """
    nodes = list(dict.fromkeys(unwrapped(t.node(v)) for v in values))
    seen = shown(nodes)
    for node in (unwrapped(v.node) for v in entering):
        if not is_sure(node, seen):
            nodes.append(node)
            seen |= shown([node])
    live = [t.wrapped(node) for node in nodes if node.constant is None]
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
