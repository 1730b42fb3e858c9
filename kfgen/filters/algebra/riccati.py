"""The steady state of a Kalman filter whose model does not change, by numbers of 120 digits at generation time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath

from kfgen.filters.algebra.factors import udu
from kfgen.ir.constants import DIGITS, to_fraction, to_mpf

Exact = list[list[Fraction]]

_DOUBLINGS = 60
_PREDICTIONS = 1000  # where doubling does not apply
_SETTLED = Fraction(1, 10**30)
_STABLE = 1 - 1e-9  # the largest eigenvalue of F (I - K H) of a filter that forgets its start
_SMALLEST = Fraction(1, 10**10)  # a covariance below it settles absolutely, not relative to itself


@dataclass(frozen=True)
class Rules:
    """What departs from the optimal gain: innovation_floor, gain_limit, the indices of `consider`."""

    floor: Fraction | None = None
    limit: Fraction | None = None
    consider: frozenset[int] = frozenset()

    @property
    def optimal(self) -> bool:
        return self.floor is None and self.limit is None and not self.consider


@dataclass(frozen=True)
class Scalar:
    """One scalar measurement of an update: nu = y times `row` (m,), of variance s."""

    row: list[Fraction]
    s: Fraction
    limited: bool = False  # whether gain_limit acts


@dataclass(frozen=True)
class Gain:
    """Of one sensor, after those before it: x <- x + K y (n, m), P after the update (n, n), its scalars as they
    are made, and those of the textbook's update."""

    K: Exact
    P: Exact
    made: list[Scalar]
    plain: list[Scalar]
    floored: bool  # whether innovation_floor or gain_limit acts


def steady(F: Exact, Q: Exact, sensors: Sequence[tuple[Exact, Exact]], rules: Rules) -> list[Gain] | None:
    """The gains of the sensors (H, R), each used once after every prediction; None where there is no steady state.

    Where the gain is optimal, the predicted covariance solves P = F (P - P H^T (H P H^T + R)^-1 H P) F^T + Q over all
    sensors together: by structure-preserving doubling (Chu, Fan, Lin & Wang 2004, algorithm 4.1).
    """
    with mpmath.workdps(2 * DIGITS):
        A, noise = _matrix(F), _matrix(Q)
        models = [_Sensor(H, R) for H, R in sensors]
        try:
            P = _doubled(A, noise, [(_matrix(H), _matrix(R)) for H, R in sensors]) if rules.optimal else None
        except ZeroDivisionError:  # an R that is singular
            P = None
        if P is None:
            P = _iterated(A, noise, models, rules)
        if P is None:
            return None
        after, closed, gains = P, mpmath.eye(A.rows), []
        for model in models:
            judged = Rules(floor=rules.floor)
            plain = model.update(after, judged)[2]
            floored = any(a.s != b.s for a, b in zip(plain, model.update(after, Rules())[2], strict=False))
            floored = floored or len(plain) != len(model.update(after, Rules())[2])
            M, after, made = model.update(after, rules)
            floored = floored or any(a.limited for a in made)
            closed = closed - M * model.H * closed
            gains.append(Gain(_fractions(M), _fractions(after), made, plain, floored))
        if not _settled(A * after * A.T + noise, P):
            return None
        import numpy as np  # here: a cold build of another filter does without it

        loop = np.array((A * closed).tolist(), dtype=float)
        return gains if max(abs(np.linalg.eigvals(loop))) < _STABLE else None


class _Sensor:
    """One sensor, decorrelated: R = U D U^T."""

    def __init__(self, H: Exact, R: Exact) -> None:
        U, D = udu([list(row) for row in R])
        m = len(R)
        self.H = _matrix(H)
        self.variances = [to_mpf(Fraction(d)) for d in D]
        unit = mpmath.eye(m)
        for i in range(m):
            for j in range(i + 1, m):
                unit[i, j] = to_mpf(Fraction(U[i][j]))
        self.inverse = mpmath.inverse(unit)
        self.rows = self.inverse * self.H

    def update(self, P: Any, rules: Rules) -> tuple[Any, Any, list[Scalar]]:
        """M with x <- x + M y, the P after it, and the scalars."""
        n, m = P.rows, self.rows.rows
        M, scalars = mpmath.zeros(n, m), []
        for k in range(m):
            h, r = self.rows[k, :], self.variances[k]
            c = P * h.T
            spread = (h * c)[0]
            if rules.floor is not None:
                r = max(r, to_mpf(rules.floor) - spread)
            s = spread + r
            if s <= to_mpf(_SETTLED) * _size(P):  # a direction already known, measured exactly
                continue
            K, limited = c / s, False
            for i in range(n):
                if i in rules.consider:
                    K[i] = mpmath.mpf(0)
                elif rules.limit is not None:
                    limited = limited or abs(K[i]) > to_mpf(rules.limit)
                    K[i] = min(max(K[i], -to_mpf(rules.limit)), to_mpf(rules.limit))
            row = self.inverse[k, :] - h * M
            M = M + K * row
            rest = mpmath.eye(n) - K * h
            P = rest * P * rest.T + r * K * K.T
            scalars.append(Scalar([to_fraction(row[i]) for i in range(m)], to_fraction(s), limited))
        return M, P, scalars


def _doubled(F: Any, Q: Any, models: list[tuple[Any, Any]]) -> Any:
    """P after 2^k predictions from the identity, k ascending until it has settled."""
    n = F.rows
    G = mpmath.zeros(n)
    for H, R in models:
        G = G + H.T * mpmath.inverse(R) * H
    A, X = F.T, Q
    one = mpmath.eye(n)
    last = None
    for _ in range(_DOUBLINGS):
        inner = mpmath.inverse(one + G * X)
        A, G, X = A * inner * A, G + A * inner * G * A.T, X + A.T * X * inner * A
        P = X + A.T * mpmath.inverse(one + G) * A
        P = (P + P.T) / 2
        if last is not None and _settled(P, last):
            return P
        last = P
    return None


def _iterated(F: Any, Q: Any, models: list[_Sensor], rules: Rules) -> Any:
    """P after as many predictions as it takes, from the identity."""
    P = mpmath.eye(F.rows)
    for _ in range(_PREDICTIONS):
        after = P
        for model in models:
            after = model.update(after, rules)[1]
        new = F * after * F.T + Q
        if _settled(new, P):
            return new
        P = new
    return None


def _settled(new: Any, old: Any) -> bool:
    return bool(_size(new - old) <= to_mpf(_SETTLED) * (_size(new) + to_mpf(_SMALLEST)))


def _matrix(rows: Exact) -> Any:
    return mpmath.matrix([[to_mpf(v) for v in row] for row in rows])


def _fractions(matrix: Any) -> Exact:
    return [[to_fraction(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)]


def _size(matrix: Any) -> Any:
    return max(abs(v) for v in matrix)
