"""Functions of rotations as values of a traced program: exact where they are 0 / 0, without cancellation beside it."""

from __future__ import annotations

import math
from fractions import Fraction

from kfgen.ir.trace import Trace, Value

_NEAR = Fraction(1, 4)  # s up to which the series is used: a rotation of up to 1 rad
_ROUNDING = Fraction(1, 2**56)
_FLAT = Fraction(1, 10**12)


def stumpff(t: Trace, k: int, s: Value) -> Value:
    """c_k(s), s >= 0: sum of (-s)^j / (2 j + k)!."""
    if s.constant is not None:
        return _series(t, k, s) if s.constant <= _NEAR else _closed(t, k, s)
    return t.select(s > _NEAR, _closed(t, k, s), _series(t, k, s))


def _closed(t: Trace, k: int, s: Value) -> Value:
    if k > 1:
        return (Fraction(1, math.factorial(k - 2)) - _closed(t, k - 2, s)) / s
    root = t.function("sqrt", s)
    return t.function("cos", root) if k == 0 else t.function("sin", root) / root


def _series(t: Trace, k: int, s: Value) -> Value:
    terms = 1
    while _NEAR**terms / math.factorial(2 * terms + k) > _ROUNDING:
        terms += 1
    total = t.value(Fraction(1, math.factorial(2 * (terms - 1) + k)))
    for j in reversed(range(terms - 1)):
        total = Fraction(1, math.factorial(2 * j + k)) - s * total
    return total


def log_scale(t: Trace, w: Value, s: Value) -> Value:
    """2 atan2(sqrt s, |w|) / sqrt s, with the sign of w (+ at 0)."""
    root, size = t.function("sqrt", s), t.function("abs", w)
    scale = t.select(s > 0, 2 * t.function("atan2", root, size) / root, 2 / size)
    return t.select(w < 0, -scale, scale)


def log_slope(t: Trace, w: Value, s: Value) -> Value:
    """Its derivative by s: (w / (w^2 + s) - scale / 2) / s, at 0 the limit."""
    far = (w / (w * w + s) - log_scale(t, w, s) * Fraction(1, 2)) / s
    return t.select(s > _FLAT, far, Fraction(-2, 3) / (w * w * w))
