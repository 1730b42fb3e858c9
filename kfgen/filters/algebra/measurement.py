"""Scalar measurements of a covariance U D U^T: Bierman's update, and a column taken away by the same kernel."""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.filters.algebra.linalg import Rows, Vector, dot, times
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    assume_positive,
    is_one,
    is_positive,
    is_zero,
    reciprocal,
    select,
)  # fmt: skip
from kfgen.filters.algebra.sweep import Matrix, Unrolled
from kfgen.filters.algebra.swept import remove


@dataclass(frozen=True)
class Measurement:
    """A scalar measurement: its row h (n,), its variance r, and its weight g, 1 but for robust updates.

    An update with it makes s = r + g h P h^T, K = P h^T / s, P - g K s K^T. least: where r may be 0, what s has to be
    above after some columns of U to be more than their round-off.
    """

    h: Vector
    r: Number
    g: Number = 1
    least: Number = 0


def bierman(U: Rows, D: Vector, measurements: list[Measurement]) -> tuple[Rows, Vector]:
    """Scalar measurement updates one after another, in place (Bierman 1977, V.2).

    Normalised, so that k ends as the gain: U_ij -= g f_j k_i, k_i += b U_ij, k_j = b. The measurements take one
    column of U after another together. Returns the gains (m, n) and the s (m,). A zero s gives a zero gain and
    changes nothing.
    """
    n = len(D)
    K = [[0] * n for _ in measurements]
    s = [measurement.r for measurement in measurements]
    for j in range(n):
        column = [U[i][j] for i in range(j)]
        steps: list[tuple[Vector, Number, Number]] = []

        def element(i: int, column: Vector = column, steps: list[tuple[Vector, Number, Number]] = steps) -> Number:
            """U_ij after the measurements so far."""
            u = column[i]
            for k, f, _ in steps:
                u = u if is_zero(k[i]) else u - f * k[i]
            return u

        for c, measurement in enumerate(measurements):
            h = measurement.h
            f = dot([element(i) if not is_zero(h[i]) else 0 for i in range(j)] + [1], h[: j + 1])
            if is_zero(f) or is_zero(D[j]):
                continue
            weighted = times(measurement.g, f)
            b, D[j], s[c] = _gain(D[j], f, weighted, s[c], measurement.least)
            steps.append((K[c], weighted, b))
        for i in reversed(range(j)):
            u = column[i]
            for k, f, b in steps:
                if not is_zero(k[i]):
                    u = u - f * k[i]
                if not is_zero(u):
                    k[i] = k[i] + b * u
            U[i][j] = u
        for k, _, b in steps:
            k[j] = b
    return K, s


def downdate(
    U: Rows, D: Vector, c: Vector, s: Number, tolerance: Number, smallest: Vector | None = None
) -> tuple[Number, Number]:
    """U D U^T -= c c^T / s, s > 0, in place: Bierman's update for an h with P h^T = c and r = s - h P h^T.

    Returns the condition of failure, that the result is not positive semidefinite by more than `tolerance` of s, and
    whether r came out negative by less and was taken as 0. A pivot that is not above `smallest` is a direction
    without spread: what c has there is round-off.
    """
    known = None if smallest is None else lambda j: ~(D[j] > smallest[j])
    r = remove(Unrolled(), len(D), Matrix(U), D, list(c), s, known)
    return ~(r >= -(s * tolerance)), r < 0


def _gain(D: Number, f: Number, weighted: Number, before: Number, least: Number) -> tuple[Number, Number, Number]:
    """b, the new D and s of one column: s = before + g f^2 D, b = D f / s, D' = D before / s. weighted: g f.

    An s that is not above `least` is what rounding leaves of an f that is 0: 1 / f would drown all later columns.
    """
    v = D if is_one(f) else D * f
    s = before + weighted * v
    if is_positive(before):
        assume_positive(s)
        inverse = 1 / s
        return v * inverse, assume_nonnegative(D * (before * inverse)), s
    some, inverse = reciprocal(assume_nonnegative(s), least)
    return v * inverse, assume_nonnegative(D * select(some, before * inverse, 1)), s
