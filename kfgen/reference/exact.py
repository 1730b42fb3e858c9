"""Constant subexpressions, folded exactly and rounded to float64 once (0.5*0.1**2 is 0.005).

Rationals stay rationals; whatever leaves them (sin, fractional powers, pi) is carried with 60 digits.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import mpmath

_MP: Any = mpmath.MPContext()
_MP.dps = 60

# a Fraction, an mpf with 60 digits, or (for conditions) a bool
Exact = Any

PI: Exact = +_MP.pi
E: Exact = +_MP.e

# a power whose exact value would have more bits than this is carried with 60 digits
_MOST_BITS = 20_000


def to_float(value: Exact) -> float:
    """The nearest float64; an overflow is an infinity."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _real(value: Exact) -> Any:
    if isinstance(value, Fraction):
        return _MP.mpf(value.numerator) / value.denominator
    return value


def _both(function: Callable[[Any, Any], Exact]) -> Callable[[Any, Any], Exact]:
    """`function`, exact where both operands are rational, with 60 digits otherwise."""

    def apply(a: Exact, b: Exact) -> Exact:
        if isinstance(a, Fraction) and isinstance(b, Fraction):
            return function(a, b)
        return function(_real(a), _real(b))

    return apply


def _power(a: Exact, b: Exact) -> Exact:
    if isinstance(a, Fraction) and isinstance(b, Fraction) and b.denominator == 1:
        bits = a.numerator.bit_length() + a.denominator.bit_length()
        if bits * abs(b.numerator) <= _MOST_BITS:
            return a**b.numerator
    return _MP.power(_real(a), _real(b))


def _sign(a: Exact) -> Exact:
    return Fraction((a > 0) - (a < 0))


def _floor(a: Exact) -> Exact:
    return Fraction(a.__floor__()) if isinstance(a, Fraction) else Fraction(int(_MP.floor(a)))


def _ratio(a: Exact, b: Exact) -> Exact:
    return _both(operator.truediv)(a, b)


def _table(x: Exact, *points: Exact) -> Exact:
    half = len(points) // 2
    knots, heights = points[:half], points[half:]
    subtract, less = _both(operator.sub), _both(operator.lt)
    if less(x, knots[0]):
        return heights[0]
    for i in range(half - 1):
        if less(x, knots[i + 1]):
            part = _ratio(subtract(x, knots[i]), subtract(knots[i + 1], knots[i]))
            rise = subtract(heights[i + 1], heights[i])
            return _both(operator.add)(heights[i], _both(operator.mul)(part, rise))
    return heights[-1]


def _rotation(i: Exact, j: Exact, w: Exact, *v: Exact) -> Exact:
    """Row i, column j of the matrix of the unit quaternion (w, v)."""
    add, multiply = _both(operator.add), _both(operator.mul)
    if i == j:
        a, b = (v[k] for k in range(3) if k != i)
        return _both(operator.sub)(Fraction(1), multiply(Fraction(2), add(multiply(a, a), multiply(b, b))))
    turned = multiply(w, v[3 - int(i) - int(j)])
    turned = turned if (j - i) % 3 == 2 else -turned
    return multiply(Fraction(2), add(multiply(v[int(i)], v[int(j)]), turned))


def _rotation_vector(k: Exact, w: Exact, *v: Exact) -> Exact:
    size = _MP.norm([_real(component) for component in v])
    if size == 0:
        return Fraction(0)
    angle = 2 * _MP.atan2(size, abs(_real(w)))
    return angle * (-1 if w < 0 else 1) * _real(v[int(k)]) / size


def _from_rotation_vector(k: Exact, *d: Exact) -> Exact:
    angle = _MP.norm([_real(component) for component in d])
    if angle == 0:
        return Fraction(int(k == 0))
    return _MP.cos(angle / 2) if k == 0 else _real(d[int(k) - 1]) / angle * _MP.sin(angle / 2)


# op -> how many of its arguments are the numbers of a part
ROTATIONS = {"rotation": 2, "rotation_vector": 1, "from_rotation_vector": 1}


def _elementary(name: str) -> Callable[..., Exact]:
    function = getattr(_MP, name)
    return lambda *arguments: function(*(_real(a) for a in arguments))


_ARITHMETIC: dict[str, Callable[..., Exact]] = {
    "add": _both(operator.add),
    "sub": _both(operator.sub),
    "mul": _both(operator.mul),
    "div": _both(operator.truediv),
    "pow": _power,
    "neg": operator.neg,
    "lt": _both(operator.lt),
    "le": _both(operator.le),
    "gt": _both(operator.gt),
    "ge": _both(operator.ge),
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
    "abs": abs,
    "sign": _sign,
    "floor": _floor,
    "min": lambda a, b: a if _both(operator.le)(a, b) else b,
    "max": lambda a, b: a if _both(operator.ge)(a, b) else b,
    "where": lambda condition, a, b: a if condition else b,
    "table": _table,
    "rotation": _rotation,
    "rotation_vector": _rotation_vector,
    "from_rotation_vector": _from_rotation_vector,
}
_OPERATIONS = _ARITHMETIC | {
    name: _elementary(name)
    for name in (
        "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
        "hypot",
    )
}  # fmt: skip


def fold(op: str, arguments: Sequence[Exact]) -> Exact | None:
    """The exact value of an operation on constants; None where it has none (a pole, a complex result)."""
    try:
        value = _OPERATIONS[op](*arguments)
    except (ZeroDivisionError, ValueError, OverflowError):
        return None
    if isinstance(value, bool | Fraction):
        return value
    return value if isinstance(value, _MP.mpf) and _MP.isfinite(value) else None
