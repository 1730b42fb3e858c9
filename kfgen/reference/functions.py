"""The spec language's real functions with their first and second derivatives, total over the floats.

Every function follows IEEE 754: a pole is an infinity, a domain error is NaN, nothing raises. At the points
where the mathematical derivative does not exist, the language defines it: those of abs, sqrt, hypot and atan2
are 0 at the origin, sign and floor are flat everywhere, sign(0) = 0. Any other singular derivative (asin at
1, x**0.3 at 0) is the infinity or NaN that its formula gives. Derivatives: Abramowitz & Stegun 1964, chapter
4.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Function1 = Callable[[float], float]
Function2 = Callable[[float, float], float]


def divide(a: float, b: float) -> float:
    """a / b as IEEE 754 has it: x/0 is an infinity of the right sign, 0/0 is NaN."""
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def power(a: float, b: float) -> float:
    """a ** b in the reals: 0 to a negative power is infinite, a fractional power below 0 is NaN."""
    try:
        return math.pow(a, b)
    except ValueError:
        return math.inf if a == 0.0 else math.nan
    except OverflowError:
        return -math.inf if a < 0.0 and math.fmod(b, 2.0) != 0.0 else math.inf


def _sine(v: float) -> float:
    return math.sin(v) if math.isfinite(v) else math.nan


def _cosine(v: float) -> float:
    return math.cos(v) if math.isfinite(v) else math.nan


def _tangent(v: float) -> float:
    return math.tan(v) if math.isfinite(v) else math.nan


def _arcsine(v: float) -> float:
    return math.asin(v) if abs(v) <= 1.0 else math.nan


def _arccosine(v: float) -> float:
    return math.acos(v) if abs(v) <= 1.0 else math.nan


def _exponential(v: float) -> float:
    try:
        return math.exp(v)
    except OverflowError:
        return math.inf


def _sinh(v: float) -> float:
    try:
        return math.sinh(v)
    except OverflowError:
        return math.copysign(math.inf, v)


def _cosh(v: float) -> float:
    try:
        return math.cosh(v)
    except OverflowError:
        return math.inf


def _logarithm(v: float) -> float:
    if v > 0.0:
        return math.log(v)
    return -math.inf if v == 0.0 else math.nan


def _root(v: float) -> float:
    return math.sqrt(v) if v >= 0.0 else math.nan


def _sign(v: float) -> float:
    return v if v == 0.0 or v != v else math.copysign(1.0, v)


def _floor(v: float) -> float:
    return float(math.floor(v)) if math.isfinite(v) else v


def _flat(v: float) -> float:
    return 0.0 if v == v else v


def _arc_slope(v: float) -> float:
    """d asin(v) / dv = 1 / sqrt(1 - v^2), written without cancellation near 1."""
    return divide(1.0, _root((1.0 - v) * (1.0 + v)))


def _arc_bend(v: float) -> float:
    return v * _arc_slope(v) ** 3


def _tangent_slope(v: float) -> float:
    return 1.0 + _tangent(v) ** 2


def _tangent_bend(v: float) -> float:
    return 2.0 * _tangent(v) * _tangent_slope(v)


def _tanh_slope(v: float) -> float:
    return (1.0 - math.tanh(v)) * (1.0 + math.tanh(v))


def _tanh_bend(v: float) -> float:
    return -2.0 * math.tanh(v) * _tanh_slope(v)


def _root_slope(v: float) -> float:
    return 0.0 if v == 0.0 else divide(0.5, _root(v))


def _root_bend(v: float) -> float:
    return 0.0 if v == 0.0 else divide(-0.25, v * _root(v))


# name -> value, first derivative, second derivative
UNARY: dict[str, tuple[Function1, Function1, Function1]] = {
    "sin": (_sine, _cosine, lambda v: -_sine(v)),
    "cos": (_cosine, lambda v: -_sine(v), lambda v: -_cosine(v)),
    "tan": (_tangent, _tangent_slope, _tangent_bend),
    "asin": (_arcsine, _arc_slope, _arc_bend),
    "acos": (_arccosine, lambda v: -_arc_slope(v), lambda v: -_arc_bend(v)),
    "atan": (math.atan, lambda v: 1.0 / (1.0 + v * v), lambda v: -2.0 * v / (1.0 + v * v) ** 2),
    "sinh": (_sinh, _cosh, _sinh),
    "cosh": (_cosh, _sinh, _cosh),
    "tanh": (math.tanh, _tanh_slope, _tanh_bend),
    "exp": (_exponential, _exponential, _exponential),
    "log": (_logarithm, lambda v: divide(1.0, v), lambda v: divide(-1.0, v * v)),
    "sqrt": (_root, _root_slope, _root_bend),
    "abs": (abs, _sign, _flat),
    "sign": (_sign, _flat, _flat),
    "floor": (_floor, _flat, _flat),
}


def hypot_slopes(a: float, b: float) -> tuple[float, float]:
    """Gradient of hypot(a, b); (0, 0) at the origin."""
    r = math.hypot(a, b)
    return (0.0, 0.0) if r == 0.0 else (a / r, b / r)


def hypot_bends(a: float, b: float) -> tuple[float, float, float]:
    """Second derivatives (aa, ab, bb) of hypot(a, b); zero at the origin."""
    r = math.hypot(a, b)
    if r == 0.0:
        return 0.0, 0.0, 0.0
    ca, cb = a / r, b / r
    return cb * cb / r, -ca * cb / r, ca * ca / r


def atan2_slopes(y: float, x: float) -> tuple[float, float]:
    """Gradient (d/dy, d/dx) of atan2(y, x); (0, 0) at the origin."""
    r = math.hypot(y, x)
    return (0.0, 0.0) if r == 0.0 else (x / r / r, -y / r / r)


def atan2_bends(y: float, x: float) -> tuple[float, float, float]:
    """Second derivatives (yy, yx, xx) of atan2(y, x); zero at the origin."""
    r = math.hypot(y, x)
    if r == 0.0:
        return 0.0, 0.0, 0.0
    s, c = y / r, x / r
    return -2.0 * s * c / r / r, (s - c) * (s + c) / r / r, 2.0 * s * c / r / r


# name -> value, gradient, second derivatives
BINARY: dict[
    str,
    tuple[
        Function2,
        Callable[[float, float], tuple[float, float]],
        Callable[[float, float], tuple[float, float, float]],
    ],
] = {
    "hypot": (math.hypot, hypot_slopes, hypot_bends),
    "atan2": (math.atan2, atan2_slopes, atan2_bends),
}
