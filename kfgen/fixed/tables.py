"""The tables of the C routines, from exact arithmetic."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import floor, isqrt


@cache
def reciprocals() -> tuple[int, ...]:
    """2^8/d - 2^8 for d = (i + 128.5)/2^8, i = 0..127: first guesses of 1/d in [1/2, 1), relative error 2^-7.6."""
    return tuple(floor(Fraction(2**17, 2 * i + 257) + Fraction(1, 2)) - 256 for i in range(128))


@cache
def roots() -> tuple[int, ...]:
    """2^8/sqrt(d) - 2^8 for d = (i + 32.5)/2^7, i = 0..95: first guesses of 1/sqrt(d), d in [1/4, 1)."""
    return tuple((isqrt(2**26 // (2 * i + 65)) + 1) // 2 - 256 for i in range(96))
