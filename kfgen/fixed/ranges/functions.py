"""Functions of real numbers on Python floats: NaN or infinity, as in C, where Python would raise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any


def _safe(function: Callable[..., float]) -> Callable[..., float]:
    def call(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError, ZeroDivisionError):
            return math.nan

    return call


def _div(a: float, b: float) -> float:
    if b == 0:
        return math.nan if a == 0 or a != a else math.copysign(math.inf, a)
    return a / b


def _wrap(a: float, period: float) -> float:
    half = period / 2
    if math.isfinite(a) and (a > half or a <= -half):
        a -= period * math.ceil((a - half) / period)
    return a


def _segment(a: float, points: list[float]) -> int:
    return sum(1 for p in points[:-1] if p <= a) + (points[-1] < a)


FUNCTIONS: dict[str, Any] = {
    "q_div": _div,
    "wrap": _wrap,
    "segment": _segment,
    "q_abs": abs,
    "q_min": lambda a, b: b if b < a else a,
    "q_max": lambda a, b: b if b > a else a,
    "q_sign": lambda a: float((a > 0) - (a < 0)),
    "q_floor": _safe(lambda a: float(math.floor(a))),
    "q_pow": _safe(lambda a, b: float(math.pow(a, b))),
    **{f"q_{name}": _safe(getattr(math, name)) for name in (
        "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "atan2")},
}  # fmt: skip
"""Name in generated source -> function."""
