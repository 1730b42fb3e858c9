"""Guards: where a function ends with an error before it has changed anything."""

from __future__ import annotations

from functools import reduce
from operator import or_

from kfgen.filters.frame.runs import summed
from kfgen.ir.trace import Trace, Value


def inputs(t: Trace, names: tuple[str, ...]) -> None:
    """NOT_FINITE, one by one: the sum of large numbers would overflow."""
    for name in names:
        t.guard(~t.finite(t.field(f"u.{name}")), "NOT_FINITE")


def finite(t: Trace, values: list[Value]) -> None:
    """NOT_FINITE by one test for all: a sum is finite only if its terms are."""
    live = list({v.node: v for v in map(t.value, values) if v.constant is None}.values())
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
