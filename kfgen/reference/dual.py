"""Forward-mode automatic differentiation: numbers that carry their gradient and, if asked, their Hessian.

A Dual of k variables is v + g.d + d^T H d / 2 with d the small change of those variables (Griewank & Walther
2008, chapters 3 and 13). A plain float is a constant: it carries no derivatives and costs nothing. Whatever
is written for `Number` runs on both.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kfgen.reference.functions import BINARY, UNARY, Function1, Function2, divide, power

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Dual:
    """A value, its gradient (k), and its Hessian (k, k), which is None where first order is enough."""

    value: float
    gradient: Vector
    hessian: Matrix | None = None

    def __add__(self, other: Number) -> Number:
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.gradient, self.hessian)
        hessian = None
        if self.hessian is not None and other.hessian is not None:
            hessian = self.hessian + other.hessian
        return Dual(self.value + other.value, self.gradient + other.gradient, hessian)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.gradient, None if self.hessian is None else -self.hessian)

    def __sub__(self, other: Number) -> Number:
        return self + (-other)

    def __rsub__(self, other: float) -> Number:
        return (-self) + other

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Dual):
            hessian = None if self.hessian is None else self.hessian * other
            return Dual(self.value * other, self.gradient * other, hessian)
        return _chain2(self, other, self.value * other.value, other.value, self.value, _product_bends)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Number:
        return quotient(self, other)

    def __rtruediv__(self, other: float) -> Number:
        return quotient(other, self)


Number = float | Dual
Bends = Callable[[float, float], tuple[float, float, float]]


def _product_bends(a: float, b: float) -> tuple[float, float, float]:
    return 0.0, 1.0, 0.0


def _chain1(x: Dual, value: float, slope: float, bend: Callable[[float], float]) -> Dual:
    """f(x) from f, f' and (evaluated only for second order) f'' at x's value."""
    hessian = None
    if x.hessian is not None:
        hessian = bend(x.value) * np.outer(x.gradient, x.gradient) + slope * x.hessian
    return Dual(value, slope * x.gradient, hessian)


def _chain2(a: Dual, b: Dual, value: float, slope_a: float, slope_b: float, bends: Bends) -> Dual:
    """f(a, b) from f, its gradient and (evaluated only for second order) its second derivatives."""
    hessian = None
    if a.hessian is not None and b.hessian is not None:
        aa, ab, bb = bends(a.value, b.value)
        cross = np.outer(a.gradient, b.gradient)
        hessian = (
            aa * np.outer(a.gradient, a.gradient)
            + ab * (cross + cross.T)
            + bb * np.outer(b.gradient, b.gradient)
            + slope_a * a.hessian
            + slope_b * b.hessian
        )
    return Dual(value, slope_a * a.gradient + slope_b * b.gradient, hessian)


def value_of(x: Number) -> float:
    """The value of a number, derivatives dropped."""
    return x.value if isinstance(x, Dual) else x


def variables(values: Sequence[float] | Vector, order: int = 1) -> list[Number]:
    """Independent variables at the given values: the gradient of number i is e_i, its Hessian (order 2) 0."""
    k = len(values)
    unit = np.eye(k)
    zero = np.zeros((k, k)) if order == 2 else None
    return [Dual(float(v), unit[i], zero) for i, v in enumerate(values)]


def jacobian(numbers: Sequence[Number], k: int) -> Matrix:
    """Gradients of m numbers of k variables as an (m, k) matrix; constants give rows of 0."""
    rows = np.zeros((len(numbers), k))
    for i, number in enumerate(numbers):
        if isinstance(number, Dual):
            rows[i] = number.gradient
    return rows


def hessian(number: Number, k: int) -> Matrix:
    """The Hessian (k, k) of a number of k variables; that of a constant is 0."""
    if isinstance(number, Dual) and number.hessian is not None:
        return number.hessian
    return np.zeros((k, k))


def values(numbers: Sequence[Number]) -> Vector:
    """Values of m numbers as a vector (m)."""
    return np.array([value_of(number) for number in numbers], dtype=np.float64)


def _quotient_bends(a: float, b: float) -> tuple[float, float, float]:
    inverse = divide(1.0, b)
    return 0.0, -inverse * inverse, 2.0 * a * inverse**3


def quotient(a: Number, b: Number) -> Number:
    """a / b."""
    va, vb = value_of(a), value_of(b)
    value = divide(va, vb)
    if isinstance(b, Dual):
        inverse = divide(1.0, vb)
        if isinstance(a, Dual):
            return _chain2(a, b, value, inverse, -value * inverse, _quotient_bends)
        return _chain1(b, value, -value * inverse, lambda v: _quotient_bends(va, v)[2])
    if isinstance(a, Dual):
        return _chain1(a, value, divide(1.0, vb), lambda v: 0.0)
    return value


def apply1(name: str) -> Callable[[Number], Number]:
    """The function of one argument of that name, on numbers."""
    return lifted1(*UNARY[name])


def lifted1(function: Function1, slope: Function1, bend: Function1) -> Callable[[Number], Number]:
    """A function of one argument with its first and second derivative, on numbers."""

    def apply(x: Number) -> Number:
        if isinstance(x, Dual):
            return _chain1(x, function(x.value), slope(x.value), bend)
        return function(x)

    return apply


def apply2(name: str) -> Callable[[Number, Number], Number]:
    """The function of two arguments of that name, on numbers."""
    return lifted2(*BINARY[name])


def lifted2(
    function: Function2, slopes: Callable[[float, float], tuple[float, float]], bends: Bends
) -> Callable[[Number, Number], Number]:
    """A function of two arguments with its gradient and its second derivatives, on numbers."""

    def apply(a: Number, b: Number) -> Number:
        va, vb = value_of(a), value_of(b)
        value = function(va, vb)
        if isinstance(a, Dual):
            slope_a, slope_b = slopes(va, vb)
            if isinstance(b, Dual):
                return _chain2(a, b, value, slope_a, slope_b, bends)
            return _chain1(a, value, slope_a, lambda v: bends(v, vb)[0])
        if isinstance(b, Dual):
            return _chain1(b, value, slopes(va, vb)[1], lambda v: bends(va, v)[2])
        return value

    return apply


def power_constant(x: Number, p: float) -> Number:
    """x ** p with a constant exponent: x**0 is the constant 1, x**0.5 is sqrt(x) with its slope of 0 at 0."""
    if p == 0.5:
        return apply1("sqrt")(x)
    if not isinstance(x, Dual):
        return power(x, p)
    if p == 0.0:
        return 1.0
    return _chain1(x, power(x.value, p), p * power(x.value, p - 1.0), lambda v: _power_bend(v, p))


def _power_bend(v: float, p: float) -> float:
    return 0.0 if p in (0.0, 1.0) else p * (p - 1.0) * power(v, p - 2.0)


def power_general(a: Number, b: Number) -> Number:
    """a ** b with an exponent known only at run time: d/db = a**b log(a).

    Here 1/2 is an exponent like any other: the slope at 0 is infinite, not that of sqrt.
    """
    va, vb = value_of(a), value_of(b)
    value = power(va, vb)
    slope_a = vb * power(va, vb - 1.0) if vb != 0.0 else 0.0
    if not isinstance(b, Dual):
        return _chain1(a, value, slope_a, lambda v: _power_bend(v, vb)) if isinstance(a, Dual) else value
    log = UNARY["log"][0](va)
    if not isinstance(a, Dual):
        return _chain1(b, value, value * log, lambda v: value * log * log)

    def bends(p: float, q: float) -> tuple[float, float, float]:
        return _power_bend(p, q), power(p, q - 1.0) * (1.0 + q * log), value * log * log

    return _chain2(a, b, value, slope_a, value * log, bends)


def minimum(a: Number, b: Number) -> Number:
    """The smaller one, the first where they are equal; NaN if either is."""
    va, vb = value_of(a), value_of(b)
    if va != va or vb != vb:
        return math.nan
    return a if va <= vb else b


def maximum(a: Number, b: Number) -> Number:
    """The larger one, the first where they are equal; NaN if either is."""
    va, vb = value_of(a), value_of(b)
    if va != va or vb != vb:
        return math.nan
    return a if va >= vb else b


def table(x: Number, knots: Sequence[float], heights: Sequence[Number]) -> Number:
    """Piecewise linear through (knots, heights), clamped outside.

    The slope at a knot is that of the segment to its right, at the last knot to its left; outside it is 0.
    """
    v = value_of(x)
    if v != v:
        return math.nan
    if v < knots[0]:
        return heights[0]
    if v > knots[-1]:
        return heights[-1]
    i = min(bisect_right(knots, v), len(knots) - 1) - 1
    slope = quotient(heights[i + 1] - heights[i], knots[i + 1] - knots[i])
    return heights[i] + (x - knots[i]) * slope
