"""SymPy functions whose derivatives are what an engineer expects: defined almost everywhere, never a Dirac.

SymPy's own Abs, sign, Min, Max, Piecewise, atan2 and sqrt derive to expressions that are NaN or a Dirac
delta at points where a filter may well start (0, for one). These derive to 0 there.
"""

from __future__ import annotations

from typing import Any

import sympy
from sympy import Function, Integer, Rational, S


class KfFunction(Function):  # type: ignore[misc] # SymPy has no types
    """Base: no evaluation, no assumption beyond being a number."""

    @classmethod
    def eval(cls, *args: Any) -> Any:
        return None


class Less(KfFunction):
    """a < b; a truth value, piecewise constant."""

    def _eval_derivative(self, s: Any) -> Any:
        return S.Zero


class LessEqual(Less):
    """a <= b."""


class Both(Less):
    """a and b."""


class Either(Less):
    """a or b."""


class Negation(Less):
    """not a."""


class Floor(Less):
    """The largest integer not above; its derivative is 0 almost everywhere."""


class Sign(Less):
    """-1, 0, 1."""


class Where(KfFunction):
    """Where(condition, a, b)."""

    @classmethod
    def eval(cls, *args: Any) -> Any:
        return args[1] if args[1] == args[2] else None

    def _eval_derivative(self, s: Any) -> Any:
        condition, a, b = self.args
        return Where(condition, a.diff(s), b.diff(s))


class Minimum(KfFunction):
    """The smaller; of equals the first."""

    def _eval_derivative(self, s: Any) -> Any:
        a, b = self.args
        return Where(Less(b, a), b.diff(s), a.diff(s))


class Maximum(KfFunction):
    """The larger; of equals the first."""

    def _eval_derivative(self, s: Any) -> Any:
        a, b = self.args
        return Where(Less(a, b), b.diff(s), a.diff(s))


class Absolute(KfFunction):
    def _eval_derivative(self, s: Any) -> Any:
        return Sign(self.args[0]) * self.args[0].diff(s)


class SafeReciprocal(KfFunction):
    """1/a for a > 0, else 0."""

    @classmethod
    def eval(cls, *args: Any) -> Any:
        if args[0].is_Rational:
            return 1 / args[0] if args[0] > 0 else S.Zero
        return None

    def _eval_derivative(self, s: Any) -> Any:
        return -(self**2) * self.args[0].diff(s)


class Root(KfFunction):
    """sqrt; derivative 0 at 0."""

    @classmethod
    def eval(cls, *args: Any) -> Any:
        a = args[0]
        if a.is_Rational and a >= 0:
            root = sympy.sqrt(a)
            return root if root.is_Rational else None
        return None

    def _eval_power(self, exponent: Any) -> Any:
        """sqrt(a)**2 is a: a variance from a standard deviation of 5*sqrt(dt) is 25*dt."""
        return self.args[0] ** (exponent / 2) if exponent.is_Integer and exponent % 2 == 0 else None

    def _eval_derivative(self, s: Any) -> Any:
        return Rational(1, 2) * SafeReciprocal(self) * self.args[0].diff(s)


class Norm(KfFunction):
    """sqrt of the sum of squares of the arguments; derivative 0 at the origin."""

    def _eval_derivative(self, s: Any) -> Any:
        return SafeReciprocal(self) * sympy.Add(*[a * a.diff(s) for a in self.args])


class Atan2(KfFunction):
    """atan2(y, x); derivative 0 at the origin."""

    def _eval_derivative(self, s: Any) -> Any:
        y, x = self.args
        return SafeReciprocal(x**2 + y**2) * (x * y.diff(s) - y * x.diff(s))


class Table(KfFunction):
    """Piecewise linear: Table(x, x1, x2, ..., y1, y2, ...), clamped at the ends."""

    def _eval_derivative(self, s: Any) -> Any:
        return Slope(*self.args) * self.args[0].diff(s)


class Slope(Less):
    """The slope of a Table; 0 outside of it, at its ends that of the segment inside."""


def root(argument: Any) -> Any:
    """sqrt of an expression; of a sum of squares the norm, which has its derivative at 0."""
    terms = sympy.Add.make_args(argument)
    sides = []
    for term in terms:
        coefficient, rest = term.as_coeff_Mul()
        base, exponent = rest.as_base_exp()
        scale = sympy.sqrt(coefficient) if coefficient.is_positive else None
        if exponent == 2:
            side = base
        elif rest == 1:
            side = S.One
        else:
            side = _square_root(rest)
        if side is None or scale is None or not scale.is_Rational:
            return Root(argument)
        sides.append(scale * side)
    if any(side.free_symbols for side in sides):
        return Norm(*sides)
    return Root(argument)


def _square_root(product: Any) -> Any:
    """The factor whose square a product of even powers is, or None."""
    out = Integer(1)
    for factor in sympy.Mul.make_args(product):
        base, exponent = factor.as_base_exp()
        if not (exponent.is_Integer and exponent > 0 and exponent % 2 == 0):
            return None
        out *= base ** (exponent / 2)
    return out
