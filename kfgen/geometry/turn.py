"""The exponential of a rotation vector and its derivatives: entire functions of |d|^2, series where that is small.

c0 = cos a, c1 = sin a / a, c2 = (1 - cos a) / a^2, c3 = (a - sin a) / a^3 with a^2 = |d|^2 (Stumpff 1959).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

from kfgen.ir.trace import Trace, Value

Rows = list[list[Any]]
NEAR = Fraction(1, 4)
"""Squared half angles up to which series are used where no bound is known: rotations of up to 1 rad."""


class Turn:
    """A rotation by d (3,), in rad. bound: of |d|^2, where one is known: its polynomials then need no branch."""

    def __init__(self, d: Sequence[Value], bound: Fraction | None = None) -> None:
        self.trace: Trace = d[0].trace
        self.d = list(d)
        self.bound = bound
        x, y, z = self.d
        self.squares = self.trace.name(self.trace.value(x * x + y * y + z * z), "angle_2")

    @cached_property
    def half(self) -> tuple[Value, Value]:
        """cos(a / 2) and sin(a / 2) / (a / 2)."""
        t, v = self.trace, self.squares * Fraction(1, 4)
        if v.constant is not None:
            if v.constant == 0:
                return t.one, t.one
            angle = t.function("sqrt", v)
            return t.function("cos", angle), t.function("sin", angle) / angle
        t.name(v, "half_2")
        limit = NEAR if self.bound is None else self.bound / 4
        cosine, sine = series(v, 0, limit), series(v, 1, limit)
        if self.bound is not None:
            return t.name(cosine, "cos_half"), t.name(sine, "sinc_half")
        cos_half, sinc_half = t.variable(t.unique("cos_half"), cosine), t.variable(t.unique("sinc_half"), sine)
        with t.when(v > limit):
            angle = t.name(t.function("sqrt", v), "half")
            cos_half.set(t.function("cos", angle))
            sinc_half.set(t.function("sin", angle) / angle)
        return t.value(cos_half.get()), t.value(sinc_half.get())

    @cached_property
    def c1(self) -> Value:
        return self.half[0] * self.half[1]

    @cached_property
    def c2(self) -> Value:
        return self.half[1] * self.half[1] * Fraction(1, 2)

    @cached_property
    def c3(self) -> Value:
        t, u = self.trace, self.squares
        if u.constant is not None:
            return t.value(Fraction(1, 6)) if u.constant == 0 else (1 - self.c1) / u
        if self.bound is not None:
            return series(u, 3, self.bound)
        found = t.variable(t.unique("cubic"), series(u, 3, 4 * NEAR))
        c1 = self.c1
        with t.when(u > 4 * NEAR):
            found.set((1 - c1) / u)
        return found.get()

    def quaternion(self) -> list[Value]:
        """exp(d)."""
        cosine, sine = self.half
        scale = sine * Fraction(1, 2)
        return [cosine, *(scale * a for a in self.d)]

    def right(self) -> Rows:
        """Jr(d) (3, 3): exp(d + e) = exp(d) exp(Jr e) to first order."""
        return self._combined(self.c1, -self.c2, self.c3)

    def left(self) -> Rows:
        """Jl(d) (3, 3): exp(d + e) = exp(Jl e) exp(d) to first order."""
        return self._combined(self.c1, self.c2, self.c3)

    def inverse(self, body: bool) -> Rows:
        """Of Jr(d), or of Jl(d), for |d| <= pi."""
        t, u = self.trace, self.squares
        cosine, sine = self.half
        near = t.value(Fraction(1, 12)) + u * (Fraction(1, 720) + u * (Fraction(1, 30240) + u * Fraction(1, 1209600)))
        square = t.variable(t.unique("bend"), near)
        with t.when(u > Fraction(1, 512)):
            square.set((1 - cosine / sine) / u)
        found, half = t.value(square.get()), t.value(Fraction(1, 2) if body else Fraction(-1, 2))
        return self._combined(1 - u * found, half, found)

    def back(self) -> Rows:
        """R(exp(d))^T (3, 3)."""
        return self._combined(1 - self.squares * self.c2, -self.c1, self.c2)

    def _combined(self, one: Value, cross: Value, outer: Value) -> Rows:
        """one I + cross [d]x + outer d d^T."""
        x, y, z = self.d
        a, b, c = (cross * e for e in self.d)
        ox, oy, oz = (outer * e for e in self.d)
        xy, xz, yz = ox * y, ox * z, oy * z
        return [
            [one + ox * x, xy - c, xz + b],
            [xy + c, one + oy * y, yz - a],
            [xz - b, yz + a, one + oz * z],
        ]


class NumericTurn:
    """The same of floats."""

    def __init__(self, d: Sequence[float]) -> None:
        self.d = [float(a) for a in d]
        self.angle = math.hypot(*self.d)

    def quaternion(self) -> list[float]:
        a = self.angle
        scale = math.sin(a / 2) / a if a > 1e-150 else 0.5
        return [math.cos(a / 2), *(scale * e for e in self.d)]


class ExactTurn:
    """The same of fractions, to 60 digits."""

    def __init__(self, d: Sequence[Fraction]) -> None:
        t = Trace()
        self.turn = Turn([t.value(a) for a in d])

    def quaternion(self) -> list[Fraction]:
        found = [a.constant for a in self.turn.quaternion()]
        return [a for a in found if a is not None]


def turn_of(d: Sequence[Any], bound: Fraction | None = None) -> Any:
    """The rotation of a vector (3,) of traced values, fractions or floats."""
    traced = [a for a in d if isinstance(a, Value)]
    if traced:
        return Turn([traced[0].trace.value(a) for a in d], bound)
    if all(isinstance(a, int | Fraction) for a in d):
        return ExactTurn([Fraction(a) for a in d])
    return NumericTurn(d)


def series(u: Value, k: int, limit: Fraction) -> Value:
    """c_k = sum of (-u)^j / (2 j + k)!, to the digits of the scalar for |u| <= limit."""
    terms = 1
    while limit**terms / math.factorial(2 * terms + k) * 8 > u.trace.epsilon:
        terms += 1
    total = u.trace.value(Fraction(1, math.factorial(2 * (terms - 1) + k)))
    for j in reversed(range(terms - 1)):
        total = Fraction(1, math.factorial(2 * j + k)) - u * total
    return total
