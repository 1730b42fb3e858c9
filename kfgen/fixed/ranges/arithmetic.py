"""Interval arithmetic on floats: what functions of numbers within spans can be; None where that has no end.

Bounds are those of real numbers; that they are computed with floats is covered by the slack of every format.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from kfgen.fixed.ranges.box import Span
from kfgen.ir.nodes import Table


def hull(*spans: Span) -> Span:
    return min(s[0] for s in spans), max(s[1] for s in spans)


def plus(a: Span, b: Span) -> Span:
    return a[0] + b[0], a[1] + b[1]


def minus(a: Span) -> Span:
    return -a[1], -a[0]


def times(a: Span, b: Span) -> Span:
    ends = [x * y for x in a for y in b]
    return min(ends), max(ends)


def square(a: Span) -> Span:
    low, high = absolute(a)
    return low * low, high * high


def over(a: Span, b: Span) -> Span | None:
    if b[0] <= 0 <= b[1]:
        return None
    ends = [x / y for x in a for y in b]
    return min(ends), max(ends)


def absolute(a: Span) -> Span:
    low, high = abs(a[0]), abs(a[1])
    return (0.0 if a[0] <= 0 <= a[1] else min(low, high)), max(low, high)


def sine(a: Span, lead: float = 0.0) -> Span:
    """sin(a + lead): 1 and -1 where a crest or a trough lies within."""
    low, high = a[0] + lead, a[1] + lead
    ends = [math.sin(low), math.sin(high)]

    def holds(angle: float) -> bool:
        return math.floor((high - angle) / (2 * math.pi)) >= math.ceil((low - angle) / (2 * math.pi))

    return (-1.0 if holds(-math.pi / 2) else min(ends)), (1.0 if holds(math.pi / 2) else max(ends))


def tangent(a: Span) -> Span | None:
    if math.floor(a[0] / math.pi + 0.5) != math.floor(a[1] / math.pi + 0.5):
        return None
    return math.tan(a[0]), math.tan(a[1])


def angle(y: Span, x: Span) -> Span:
    """atan2."""
    if x[0] <= 0 and y[0] <= 0 <= y[1]:
        return -math.pi, math.pi
    ends = [math.atan2(b, a) for a in x for b in y]
    if y[0] <= 0 <= y[1]:
        ends.append(0.0)
    if x[0] <= 0 <= x[1]:
        ends.append(math.copysign(math.pi / 2, y[1] + y[0]))
    return min(ends), max(ends)


def power(a: Span, b: Span) -> Span | None:
    """a^b of a that is not below zero, or of a whole number b."""
    if b[0] == b[1] and b[0] == math.floor(b[0]):
        n = int(b[0])
        if n < 0:
            inner = power(a, (-b[0], -b[0]))
            return None if inner is None else over((1.0, 1.0), inner)
        return hull(*((x**n, x**n) for x in (absolute(a) if n % 2 == 0 else a)))
    if a[0] < 0 or (a[0] == 0 and b[0] < 0):
        return None
    ends = [x**y for x in a for y in b]
    return min(ends), max(ends)


def wrapped(a: Span, period: float) -> Span:
    half = period / 2
    return a if -half < a[0] and a[1] <= half else (-half, half)


def looked_up(table: Table, a: Span) -> Span:
    """A table, at arguments within a."""
    xs, ys = [float(v) for v in table.x], [float(v) for v in table.y]
    found = [y for x, y in zip(xs, ys, strict=True) if a[0] <= x <= a[1]]
    for v in a:
        if v <= xs[0] or v >= xs[-1]:
            found.append(ys[0] if v <= xs[0] else ys[-1])
            continue
        for (x0, y0), (x1, y1) in pairwise(zip(xs, ys, strict=True)):
            if x0 <= v <= x1:
                found.append(y0 + (y1 - y0) * (v - x0) / (x1 - x0))
    return min(found), max(found)


def _rising(function: Callable[[float], float], low: float = -math.inf, high: float = math.inf
            ) -> Callable[[Span], Span | None]:  # fmt: skip
    """A function that rises, of arguments that are brought between low and high."""

    def applied(a: Span) -> Span:
        return function(min(max(a[0], low), high)), function(min(max(a[1], low), high))

    return applied


def _falling(a: Span) -> Span:
    return math.acos(min(max(a[1], -1.0), 1.0)), math.acos(min(max(a[0], -1.0), 1.0))


def _logarithm(a: Span) -> Span | None:
    return None if a[0] <= 0 else (math.log(a[0]), math.log(a[1]))


def _even(a: Span) -> Span:
    low, high = absolute(a)
    return math.cosh(low), math.cosh(high)


def _sign(v: float) -> float:
    return float((v > 0) - (v < 0))


UNARY: dict[str, Callable[[Span], Span | None]] = {
    "neg": minus, "abs": absolute, "sin": sine, "cos": lambda a: sine(a, math.pi / 2), "tan": tangent,
    "sqrt": _rising(math.sqrt, 0.0), "asin": _rising(math.asin, -1.0, 1.0), "acos": _falling,
    "atan": _rising(math.atan), "exp": _rising(math.exp), "sinh": _rising(math.sinh), "tanh": _rising(math.tanh),
    "cosh": _even, "log": _logarithm, "floor": _rising(lambda v: float(math.floor(v))), "sign": _rising(_sign),
}  # fmt: skip
BINARY: dict[str, Callable[[Span, Span], Span | None]] = {
    "div": over, "atan2": angle, "pow": power,
    "min": lambda a, b: (min(a[0], b[0]), min(a[1], b[1])), "max": lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
}  # fmt: skip
