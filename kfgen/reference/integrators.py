"""Runge-Kutta steps on numbers and rotations (Kutta 1901; Munthe-Kaas 1998)."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.reference.dual import Number
from kfgen.reference.manifold import Manifold

Numbers = list[Number]
Derivative = Callable[[Numbers], Numbers]


def _scaled(h: float, k: Numbers) -> Numbers:
    return [h * number for number in k]


def _euler(f: Derivative, x: Numbers, h: float, space: Manifold) -> Numbers:
    return space.along(x, _scaled(h, f(x)))


def _midpoint(f: Derivative, x: Numbers, h: float, space: Manifold) -> Numbers:
    middle = space.along(x, _scaled(0.5 * h, f(x)))
    return space.along(x, _scaled(h, f(middle)))


def _rk4(f: Derivative, x: Numbers, h: float, space: Manifold) -> Numbers:
    """The classical method, on the u with which the state is x.along(u)."""

    def rate(u: Numbers) -> Numbers:
        return space.unwound(u, f(space.along(x, u)))

    k1 = f(x)
    k2 = rate(_scaled(0.5 * h, k1))
    k3 = rate(_scaled(0.5 * h, k2))
    k4 = rate(_scaled(h, k3))
    total = [b + 2.0 * c + 2.0 * d + e for b, c, d, e in zip(k1, k2, k3, k4, strict=True)]
    return space.along(x, _scaled(h / 6.0, total))


# by name: x (n numbers) a step of h seconds later, f giving its rate: dx/dt, of a quaternion the body's angular rate
INTEGRATORS: dict[str, Callable[[Derivative, Numbers, float, Manifold], Numbers]] = {
    "euler": _euler,
    "midpoint": _midpoint,
    "rk4": _rk4,
}
