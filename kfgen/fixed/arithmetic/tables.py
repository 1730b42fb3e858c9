"""The tables and coefficients of the C routines, from exact arithmetic; the Python twins read the same."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from math import floor, isqrt
from typing import Any, NamedTuple

from mpmath import mp, mpf


class Series(NamedTuple):
    """Coefficients of a polynomial, lowest first: size of coefficient k = values[k] / 2^(32 + exponents[k])."""

    values: tuple[int, ...]
    exponents: tuple[int, ...]

    @property
    def steps(self) -> tuple[tuple[int, int], ...]:
        """What Horner's rule takes below the last: (values[k], exponents[k + 1] - exponents[k]), highest k first."""
        gaps = [after - before for before, after in zip(self.exponents, self.exponents[1:], strict=False)]
        return tuple(zip(self.values, gaps, strict=False))[::-1]

    @property
    def tail(self) -> Series:
        """All but the lowest."""
        return Series(self.values[1:], self.exponents[1:])


def fixed(value: Any, bits: int) -> int:
    """value 2^bits, to nearest."""
    return int(mp.floor(value * mpf(2) ** bits + mpf("0.5")))


def fit(function: Callable[[Any], Any], low: Any, high: Any, degree: int) -> list[Any]:
    """The polynomial that meets a function at Chebyshev's points: within a factor of two of the best of its degree."""
    n = degree + 1
    points = [(low + high) / 2 + (high - low) / 2 * mp.cos(mp.pi * (2 * i + 1) / (2 * n)) for i in range(n)]
    matrix = mp.matrix(n, n)
    for i, x in enumerate(points):
        for k in range(n):
            matrix[i, k] = x**k
    return list(mp.lu_solve(matrix, mp.matrix([function(x) for x in points])))


def series(function: Callable[[Any], Any], low: Any, high: Any, degree: int) -> Series:
    """Such a polynomial with coefficients of 32 bits, their signs dropped."""
    sizes = [abs(c) for c in fit(function, low, high, degree)]
    exponents = [-int(mp.frexp(size)[1]) for size in sizes]
    return Series(tuple(fixed(c, 32 + e) for c, e in zip(sizes, exponents, strict=True)), tuple(exponents))


@cache
def quotients() -> tuple[int, ...]:
    """2^8/d - 2^8 for d = (i + 128.5)/2^8, i = 0..127: of two numbers' first bits the quotient, for arctangents."""
    return tuple(floor(Fraction(2**17, 2 * i + 257) + Fraction(1, 2)) - 256 for i in range(128))


@cache
def reciprocals() -> tuple[int, ...]:
    """2^8/d - 2^8 for d = (i + 64.5)/2^7, i = 0..63: first guesses of 1/d in [1/2, 1), relative error 2^-6.7."""
    return tuple(floor(Fraction(2**16, 2 * i + 129) + Fraction(1, 2)) - 256 for i in range(64))


@cache
def roots() -> tuple[int, ...]:
    """2^8/sqrt(d) - 2^8 for d = (i + 32.5)/2^7, i = 0..95: first guesses of 1/sqrt(d), d in [1/4, 1)."""
    return tuple((isqrt(2**26 // (2 * i + 65)) + 1) // 2 - 256 for i in range(96))


@cache
def turn() -> tuple[int, ...]:
    """1/(2 pi) in words of 32 bits, highest first."""
    with mp.workprec(200):
        bits = int(mp.floor(mpf(2) ** 96 / (2 * mp.pi)))
    return tuple(bits >> shift & 0xFFFFFFFF for shift in (64, 32, 0))


@cache
def sine() -> Series:
    """sin(w pi/4)/w in z = w^2, 0 <= z <= 1; signs alternate."""
    with mp.workprec(200):
        return series(lambda z: mp.sin(mp.sqrt(z) * mp.pi / 4) / mp.sqrt(z), mpf(0), mpf(1), 4)


@cache
def cosine() -> Series:
    """(1 - cos(w pi/4))/w^2 in z = w^2, 0 <= z <= 1; signs alternate."""
    with mp.workprec(200):
        return series(lambda z: (1 - mp.cos(mp.sqrt(z) * mp.pi / 4)) / z, mpf(0), mpf(1), 4)


@cache
def angles() -> tuple[int, ...]:
    """2^32 atan(j/16), j = 0..16."""
    with mp.workprec(200):
        return tuple(fixed(mp.atan(mpf(j) / 16), 32) for j in range(17))


@cache
def arctangent() -> Series:
    """(u - atan(u))/u^3 in z = u^2, u <= 0.045; signs alternate."""
    with mp.workprec(200):
        return series(lambda z: (1 - mp.atan(mp.sqrt(z)) / mp.sqrt(z)) / z, mpf(0), mpf("0.045") ** 2, 1)


@cache
def pi(bits: int) -> int:
    """2^bits pi."""
    with mp.workprec(200):
        return fixed(mp.pi, bits)


@cache
def ln2(bits: int) -> int:
    """2^bits ln(2)."""
    with mp.workprec(200):
        return fixed(mp.ln2, bits)


@cache
def sixteenths() -> int:
    """2^10 16/ln(2), rounded down: sixteenths of a power of two in 1."""
    with mp.workprec(200):
        return int(mp.floor(2**14 / mp.ln2))


@cache
def powers() -> tuple[int, ...]:
    """2^32 (2^(j/16) - 1), j = 0..15."""
    with mp.workprec(200):
        return tuple(fixed(mpf(2) ** (mpf(j) / 16) - 1, 32) for j in range(16))


@cache
def exponential() -> Series:
    """(e^r - 1 - r)/r^2, 0 <= r <= 0.0443."""
    with mp.workprec(200):
        return series(lambda r: (mp.expm1(r) - r) / r**2, mpf(0), mpf("0.0443"), 2)


UPPER = 14
"""Numbers of [1, 2) from (32 + UPPER)/32 on count as their half in the table of logarithms."""


@cache
def factors() -> tuple[int, ...]:
    """2^7/v for v of interval j of 32 of [1, 2), from UPPER on [1/2, 1): v times it is within 1/32 of 1; 1 beside 1."""
    inner = [Fraction(2**7 * 64, (2 * j + 65) * (1 if j < UPPER else Fraction(1, 2))) for j in range(32)]
    return tuple(2**7 if j in (0, 31) else floor(f + Fraction(1, 2)) for j, f in enumerate(inner))


@cache
def logarithms() -> tuple[int, ...]:
    """-2^62 ln(factor/2^7)."""
    with mp.workprec(200):
        return tuple(fixed(-mp.log(mpf(f) / 128), 62) for f in factors())


@cache
def logarithm() -> tuple[int, ...]:
    """(u - ln(1 + u))/u^2, |u| <= 1/32: 2^31 times the coefficients, signs alternate and are dropped."""
    with mp.workprec(200):
        # by its hypergeometric series, which holds at 0 too
        found = fit(lambda u: mp.hyp2f1(1, 2, 3, -u) / 2, mpf(-1) / 32, mpf(1) / 32, 4)
        return tuple(fixed(abs(c), 31) for c in found)
