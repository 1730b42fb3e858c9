"""SymPy functions of rotations whose derivatives stay finite: the exponential and the logarithm of quaternions.

Stumpff functions c_k(s) = sum of (-s)^j / (2 j + k)! (Stumpff 1959): c_0 = cos sqrt s, c_1 = sin sqrt s / sqrt s.
"""

from __future__ import annotations

from typing import Any

import sympy
from sympy import Integer, Rational

from kfgen.model.functions import KfFunction, SafeReciprocal


class Stumpff(KfFunction):
    """c_k(s) of Stumpff(k, s), s >= 0: entire functions."""

    @classmethod
    def eval(cls, *args: Any) -> Any:
        k, s = args
        return 1 / sympy.factorial(k) if s == 0 else None

    def _eval_derivative(self, s: Any) -> Any:
        k, u = self.args
        return Rational(1, 2) * (k * Stumpff(k + 2, u) - Stumpff(k + 1, u)) * u.diff(s)


class LogScale(KfFunction):
    """The factor of v in the rotation vector of (w, v), s = |v|^2: 2 atan2(|v|, |w|) / |v|, with the sign of w."""

    def _eval_derivative(self, s: Any) -> Any:
        w, u = self.args
        return -2 / (w**2 + u) * w.diff(s) + LogSlope(w, u) * u.diff(s)


class LogSlope(KfFunction):
    """d LogScale(w, s) / ds = (w / (w^2 + s) - LogScale / 2) / s; at s = 0 its limit, -2 / (3 w^3)."""

    def _eval_derivative(self, s: Any) -> Any:
        w, u = self.args
        squares = w**2 + u
        bend = -(w / squares**2 + Rational(3, 2) * self) * SafeReciprocal(u)
        return 2 / squares**2 * w.diff(s) + bend * u.diff(s)


def entry(i: Any, j: Any, w: Any, x: Any, y: Any, z: Any) -> Any:
    """R(q)_ij of a unit quaternion."""
    rows = (
        (1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x**2 + z**2), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)),
    )
    return rows[int(i)][int(j)]


def rotation_vector(k: Any, w: Any, x: Any, y: Any, z: Any) -> Any:
    """Part k of the rotation vector, of q and -q the same, at most pi long."""
    return (x, y, z)[int(k)] * LogScale(w, x**2 + y**2 + z**2)


def from_rotation_vector(k: Any, x: Any, y: Any, z: Any) -> Any:
    """Part k of the quaternion of a rotation vector."""
    quarter = Rational(1, 4) * (x**2 + y**2 + z**2)
    if k == 0:
        return Stumpff(Integer(0), quarter)
    return Rational(1, 2) * (x, y, z)[int(k) - 1] * Stumpff(Integer(1), quarter)
