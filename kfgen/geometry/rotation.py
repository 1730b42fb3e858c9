"""Rotations as unit quaternions (Hamilton, scalar first), and their errors: three numbers, in rad.

q [+] d = q exp(d) with the error in the body's frame, exp(d) q with it in the reference frame (Sola, Deray & Atchuthan
2018). Numbers are traced values, fractions or floats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from kfgen.geometry.turn import Turn, turn_of
from kfgen.ir.trace import Trace, Value

Quaternion = Sequence[Any]
Three = Sequence[Any]


def product(a: Quaternion, b: Quaternion) -> list[Any]:
    """a b (Hamilton)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]


def conjugate(q: Quaternion) -> list[Any]:
    return [q[0], -q[1], -q[2], -q[3]]


def matrix(q: Quaternion) -> list[list[Any]]:
    """R(q) (3, 3) of a unit quaternion, from body to reference."""
    w, x, y, z = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


@dataclass(frozen=True)
class Rotation:
    """A unit quaternion with an error of three numbers. error: body or reference. tolerance: what is round-off."""

    error: str = "body"
    dimension = 3
    size = 4
    flat = False

    @property
    def body(self) -> bool:
        return self.error == "body"

    def placed(self, x: Quaternion) -> list[Any]:
        """Near |x| = 1: one Newton step towards it."""
        squares = _squares(x)
        scale = (3 - squares) * Fraction(1, 2) if isinstance(squares, Value) else 1 / _root(squares)
        return [a * scale for a in x]

    def normalised(self, x: Quaternion) -> list[Any]:
        """Any x but 0 on the unit sphere."""
        scale = 1 / _root(_squares(x))
        return [a * scale for a in x]

    def turned(self, x: Quaternion, by: Turn) -> list[Any]:
        """x [+] d for the rotation of d."""
        other = by.quaternion()
        return self.placed(product(x, other) if self.body else product(other, x))

    def retract(self, x: Quaternion, d: Three) -> list[Any]:
        return self.turned(x, turn_of(d))

    def local(self, a: Quaternion, b: Quaternion) -> list[Any]:
        """log of b^-1 a, or of a b^-1: the shortest way."""
        inverse = conjugate(b)
        return logarithm(product(inverse, a) if self.body else product(a, inverse))

    def moved(self, by: Turn) -> list[list[Any]]:
        """T(d) (3, 3): the error as seen from x [+] d (Mueller, Hehn & D'Andrea 2017): Jr(d), or Jl(d)."""
        return by.right() if self.body else by.left()


def logarithm(p: Quaternion) -> list[Any]:
    """The rotation vector of a unit quaternion, |.| <= pi; of q and -q the same."""
    traced = [a for a in p if isinstance(a, Value)]
    if traced:
        return _traced_logarithm(traced[0].trace, [traced[0].trace.value(a) for a in p])
    if all(isinstance(a, int | Fraction) for a in p):
        return _exact_logarithm(p)
    w, x, y, z = (float(a) for a in p)
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2 * math.atan2(sine, abs(w)) / sine if sine > 1e-150 else 2.0
    scale = -scale if w < 0 else scale
    return [scale * x, scale * y, scale * z]


def _traced_logarithm(t: Trace, p: list[Value]) -> list[Any]:
    w, x, y, z = p
    turned = w < 0
    w = t.name(t.select(turned, -w, w), "log_w")
    squares = t.name(x * x + y * y + z * z, "log_squares")
    scale = t.variable(t.unique("log_scale"), (2 - Fraction(2, 3) * squares / (w * w)) / w)
    with t.when(squares > SMALL):
        sine = t.name(t.function("sqrt", squares), "log_sine")
        scale.set(2 * t.function("atan2", sine, w) / sine)
    found = scale.get()
    signed = t.name(t.select(turned, -found, found), "log_signed")
    return [signed * a for a in (x, y, z)]


def _exact_logarithm(p: Quaternion) -> list[Any]:
    t = Trace()
    w, *rest = (t.value(-a if p[0] < 0 else a) for a in p)
    squares = rest[0] * rest[0] + rest[1] * rest[1] + rest[2] * rest[2]
    if squares.constant == 0:
        return [Fraction(0)] * 3
    sine = t.function("sqrt", squares)
    scale = 2 * t.function("atan2", sine, w) / sine
    return [(scale * v).constant for v in rest]


SMALL = Fraction(1, 2**22)
"""Squared sines below which the logarithm is its series: what this leaves out is s^4 / 5 < 2e-14."""


def _squares(x: Quaternion) -> Any:
    w, a, b, c = x
    return w * w + a * a + b * b + c * c


def _root(a: Any) -> Any:
    if isinstance(a, Value):
        return a.trace.function("sqrt", a)
    if isinstance(a, int | Fraction):
        root = Trace().function("sqrt", Fraction(a)).constant
        assert root is not None
        return root
    return math.sqrt(a)
