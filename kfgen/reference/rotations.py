"""Unit quaternions (Hamilton, scalar first) on numbers with derivatives: exponential, logarithm, product, matrix.

Sola 2017 ("Quaternion kinematics for the error-state Kalman filter"), sections 1 to 4; Munthe-Kaas 1998 for the
inverse derivative of the exponential. Everything is smooth where the rotation is: at 0, and up to half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from kfgen.reference.dual import Number, lifted1, lifted2, value_of
from kfgen.reference.functions import UNARY

Numbers = list[Number]

# below this |d|^2 the functions of it are summed as power series, whose terms fall like (s/4)^n / (2n)!
_SMALL = 1.0
_TERMS = 12
# below this (|v| / w)^2 that of the logarithm, whose terms fall like t^n
_FLAT = 0.02


def _cosine_terms(s: float, order: int) -> float:
    """The derivative, of that order, of cos(sqrt(s)/2) = sum (-s/4)^n / (2n)!."""
    return _series(s, order, [(-0.25) ** n / math.factorial(2 * n) for n in range(_TERMS)])


def _sine_terms(s: float, order: int) -> float:
    """The same of sin(sqrt(s)/2) / sqrt(s) = 1/2 sum (-s/4)^n / (2n + 1)!."""
    return _series(s, order, [0.5 * (-0.25) ** n / math.factorial(2 * n + 1) for n in range(_TERMS)])


def _series(s: float, order: int, terms: Sequence[float]) -> float:
    return sum(math.perm(n, order) * terms[n] * s ** (n - order) for n in range(order, len(terms)))


def _cosine(s: float) -> float:
    return _cosine_terms(s, 0) if s < _SMALL else UNARY["cos"][0](0.5 * math.sqrt(s))


def _sine(s: float) -> float:
    return _sine_terms(s, 0) if s < _SMALL else UNARY["sin"][0](0.5 * math.sqrt(s)) / math.sqrt(s)


def _cosine_slope(s: float) -> float:
    return -0.25 * _sine(s)


def _cosine_bend(s: float) -> float:
    return -0.25 * _sine_slope(s)


def _sine_slope(s: float) -> float:
    return _sine_terms(s, 1) if s < _SMALL else (0.5 * _cosine(s) - _sine(s)) / (2.0 * s)


def _sine_bend(s: float) -> float:
    return _sine_terms(s, 2) if s < _SMALL else (-0.125 * _sine(s) - 3.0 * _sine_slope(s)) / (2.0 * s)


def _turn(m: float, w: float) -> float:
    """2 atan2(sqrt(m), w) / sqrt(m), w >= 0: what (w, v) with |v|^2 = m is multiplied by to give its logarithm."""
    if m < _FLAT * w * w:
        return 2.0 / w * sum((-m / (w * w)) ** n / (2 * n + 1) for n in range(_TERMS))
    return 0.0 if m == 0.0 else 2.0 * math.atan2(math.sqrt(m), w) / math.sqrt(m)


def _turn_slopes(m: float, w: float) -> tuple[float, float]:
    size = m + w * w
    if size == 0.0:
        return 0.0, 0.0
    if m < _FLAT * w * w:
        t = -m / (w * w)
        slope = -2.0 / w**3 * sum(n * t ** (n - 1) / (2 * n + 1) for n in range(1, _TERMS))
    else:
        slope = (w / size - 0.5 * _turn(m, w)) / m
    return slope, -2.0 / size


def _turn_bends(m: float, w: float) -> tuple[float, float, float]:
    size = m + w * w
    if size == 0.0:
        return 0.0, 0.0, 0.0
    if m < _FLAT * w * w:
        t = -m / (w * w)
        bend = 2.0 / w**5 * sum(n * (n - 1) * t ** (n - 2) / (2 * n + 1) for n in range(2, _TERMS))
    else:
        bend = (-w / size**2 - 1.5 * _turn_slopes(m, w)[0]) / m
    return bend, 2.0 / size**2, 4.0 * w / size**2


_cosine_of = lifted1(_cosine, _cosine_slope, _cosine_bend)
_sine_of = lifted1(_sine, _sine_slope, _sine_bend)
_turn_of = lifted2(_turn, _turn_slopes, _turn_bends)


def exponential(d: Sequence[Number]) -> Numbers:
    """The quaternion of the rotation by |d| rad about d (3): (cos |d|/2, d sin(|d|/2) / |d|)."""
    square = dot(d, d)
    factor = _sine_of(square)
    return [_cosine_of(square), *(factor * component for component in d)]


def logarithm(q: Sequence[Number]) -> Numbers:
    """The rotation vector (3) of q (4), |d| <= pi; that of q / |q|, and of -q, is the same."""
    w, v = (q[0], q[1:]) if value_of(q[0]) >= 0.0 else (-q[0], [-component for component in q[1:]])
    factor = _turn_of(dot(v, v), w)
    return [factor * component for component in v]


def product(p: Sequence[Number], q: Sequence[Number]) -> Numbers:
    """p q (4): q is done first."""
    a, b, c, d = p
    w, x, y, z = q
    return [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]


def conjugate(q: Sequence[Number]) -> Numbers:
    """(w, -v): of a unit quaternion the inverse."""
    return [q[0], *(-component for component in q[1:])]


def entry(i: int, j: int, q: Sequence[Number]) -> Number:
    """Row i, column j of the matrix that takes vectors from the body to the reference, of a unit quaternion."""
    w, v = q[0], q[1:]
    if i == j:
        a, b = (v[k] for k in range(3) if k != i)
        return 1.0 - 2.0 * (a * a + b * b)
    k = 3 - i - j
    turned = w * v[k] if (j - i) % 3 == 2 else -(w * v[k])
    return 2.0 * (v[i] * v[j] + turned)


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[Number], b: Sequence[Number]) -> Numbers:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unwound(u: Sequence[Number], rate: Sequence[Number]) -> Numbers:
    """The rate (3) of u where the body turns at `rate` and its attitude is q exp(u): rate + u x rate / 2 +
    u x (u x rate) / 12, which is the inverse of the exponential's derivative to the order that rk4 needs (Hairer,
    Lubich & Wanner 2006, theorem IV.8.4)."""
    first = cross(u, rate)
    second = cross(u, first)
    return [r + 0.5 * a + b * (1.0 / 12.0) for r, a, b in zip(rate, first, second, strict=True)]
