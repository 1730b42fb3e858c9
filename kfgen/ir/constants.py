"""Functions of constants, folded at generation: exact where rational, else to 60 digits by mpmath.

The platform's libm has no part in it, so the emitted digits are the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath

DIGITS = 60


def to_fraction(value: Any) -> Fraction:
    """An mpmath number as the fraction it is."""
    sign, mantissa, exponent, _ = mpmath.mpf(value)._mpf_
    scaled = Fraction(int(mantissa)) * (Fraction(2) ** int(exponent))
    return -scaled if sign else scaled


def to_mpf(value: Fraction) -> Any:
    """A fraction to 60 digits; call inside `mpmath.workdps`."""
    return mpmath.mpf(value.numerator) / value.denominator


def pi() -> Fraction:
    """Pi to 60 digits."""
    with mpmath.workdps(DIGITS):
        return to_fraction(+mpmath.pi)


def evaluate(function: Callable[..., Any], *arguments: Fraction) -> Fraction | None:
    """function(*arguments) to 60 digits; None where the result is not a finite real number."""
    with mpmath.workdps(DIGITS):
        try:
            value = function(*[to_mpf(a) for a in arguments])
        except (ValueError, ZeroDivisionError, OverflowError):
            return None
        if isinstance(value, mpmath.mpc) or not mpmath.isfinite(value):
            return None
        return to_fraction(value)


def _sign(v: Fraction) -> int:
    return (v > 0) - (v < 0)


def fold(op: str, values: list[Fraction]) -> Fraction | None:
    """The value of a function of constants; None where it has none (it is then left to run time)."""
    a = values[0]
    if op == "abs":
        return abs(a)
    if op == "sign":
        return Fraction(_sign(a))
    if op == "floor":
        return Fraction(a.numerator // a.denominator)
    if op in ("min", "max"):
        return min(values) if op == "min" else max(values)
    if op == "pow":
        return evaluate(mpmath.power, *values)
    return evaluate(getattr(mpmath, op), *values)
