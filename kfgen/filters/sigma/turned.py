"""What sigma points see of a sensor; of measured quaternions means on the group, covariances as seen from there."""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.geometry import Space, Turn
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model


@dataclass(frozen=True)
class Seen:
    """Of a measurement of m errors: z (of all components), its covariance without R (m, m), that with the state (n, m)
    and with the carried noises (q, m)."""

    z: Vector
    spread: Symmetric
    cross: Rows
    noise: Rows


Entries = dict[tuple[int, int], Value]
"""Entries (a, b), a <= b, of a symmetric matrix."""


def point(model: Model, x: list[Value], d: list[Value]) -> list[Value]:
    """x [+] d; angles may leave their chart."""
    out = list(x)
    for i, j, _ in model.space.singles:
        out[i] = x[i] + d[j]
    for i, j, rotation in model.space.rotations:
        out[i : i + 4] = rotation.retract(x[i : i + 4], d[j : j + 3])
    return out


def mean_of(t: Trace, images: Space, base: list[Value], delta: Vector) -> tuple[list[Value], Rows | None]:
    """base [+] delta, angles not wrapped, and how deviations are seen from there (m, m), where that is another way."""
    mean, m = list(base), images.dimension
    for i, j, _ in images.singles:
        mean[i] = base[i] + delta[j]
    if not images.rotations:
        return mean, None
    T: Rows = [[t.one if i == j else t.zero for j in range(m)] for i in range(m)]
    for i, j, rotation in images.rotations:
        turn = Turn(delta[j : j + 3])
        mean[i : i + 4] = rotation.turned(base[i : i + 4], turn)
        for k, row in enumerate(rotation.moved(turn)):
            T[j + k][j : j + 3] = row
    return mean, T


def seen_spread(t: Trace, spread: Entries, T: Rows | None) -> Entries:
    """T S T^T."""
    if T is None:
        return spread
    whole = Symmetric(len(T), lambda a, b: spread[a, b])
    columns = [whole.times(row) for row in T]
    return {(a, b): t.value(linalg.dot(T[a], columns[b])) for a, b in spread}
