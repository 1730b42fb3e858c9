"""Weighted means and covariances of points, with what rounding may have done to them.

Sigma-point weights may be negative and large: what comes out as a small or slightly negative variance may be
nothing but rounding. Every covariance here carries a bound of its rounding errors, so that a covariance that
is indefinite beyond it can be told from one that is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import EPS, symmetric
from kfgen.reference.status import Status, StepError


@dataclass(frozen=True)
class Spread:
    """N points around their mean, in k coordinates.

    deviations (N, k). errors (k): bounds of the rounding of one; drift (k): of that of all of them together, by
    the mean. covariance (k, k): the weighted sum of their squares; rounding (k, k): a bound of its error.
    """

    deviations: Matrix
    errors: Vector
    drift: Vector
    covariance: Matrix
    rounding: Matrix


@dataclass(frozen=True)
class Pivots:
    """S = L diag(D) L^T, L unit lower triangular (k, k), D (k); a pivot that is 0 marks a direction to skip."""

    L: Matrix
    D: Vector

    @property
    def inverse(self) -> Vector:
        """1 / D (k), 0 where D is 0."""
        return np.array([1.0 / d if d > 0.0 else 0.0 for d in self.D])

    @property
    def root(self) -> Matrix:
        """L sqrt(D) (k, k)."""
        root: Matrix = self.L * np.sqrt(self.D)
        return root

    def squares(self, y: Vector) -> Vector:
        """The terms (k) whose sum is y^T S^-1 y."""
        terms: Vector = np.linalg.solve(self.L, y) ** 2 * self.inverse
        return terms

    def gain(self, cross: Matrix) -> Matrix:
        """cross S^-1 (n, k)."""
        whitened = np.linalg.solve(self.L, cross.T) * self.inverse[:, None]
        gain: Matrix = np.asarray(np.linalg.solve(self.L.T, whitened), dtype=np.float64).T
        return gain


def spread(deviations: Matrix, errors: Vector, drift: Vector, wc: Vector) -> Spread:
    """The covariance of deviations (N, k) with weights wc (N); errors, drift (k) bound their rounding.

    In a coordinate where the deviations differ by no more than their errors the points are taken to coincide.
    """
    same = np.ptp(deviations, axis=0) <= 2.0 * errors
    deviations = np.where(same, 0.0, deviations)
    errors, drift = np.where(same, 0.0, errors), np.where(same, 0.0, drift)
    weights, both = np.abs(wc)[:, None], errors + drift
    size = (weights * np.abs(deviations)).T
    rounding = np.outer(np.sum(size, axis=1), both)
    rounding = rounding + rounding.T + np.sum(weights) * np.outer(both, both)
    rounding += 4.0 * len(wc) * EPS * (size @ np.abs(deviations))
    return Spread(deviations, errors, drift, symmetric((wc[:, None] * deviations).T @ deviations), rounding)


def settled(P: Matrix, rounding: Matrix) -> Matrix:
    """P (n, n) as a covariance: itself, or, where only rounding makes it indefinite, the nearest one.

    Raises NOT_POSITIVE where it is indefinite beyond the bound (n, n) of its rounding errors.
    """
    n = len(P)
    variances, allowed = P.diagonal(), rounding.diagonal()
    if np.any(variances < -allowed):
        raise StepError(Status.NOT_POSITIVE)
    sigma = np.sqrt(np.maximum(variances, allowed))
    zero = sigma == 0.0
    if np.any(P[zero] != 0.0):
        raise StepError(Status.NOT_POSITIVE)
    sigma[zero] = 1.0
    correlations = P / np.outer(sigma, sigma)
    slack = np.sum(rounding / np.outer(sigma, sigma), axis=1)
    lowest = np.linalg.eigvalsh(correlations + np.diag(slack))[0]
    if lowest < -1e3 * n * EPS:
        raise StepError(Status.NOT_POSITIVE)
    values, vectors = np.linalg.eigh(correlations)
    if values[0] >= -10.0 * n * EPS:
        return P
    nearest = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return symmetric(nearest * np.outer(sigma, sigma))


def pivots(S: Matrix, smallest: Vector) -> Pivots:
    """The factors of S (k, k) in the order of its rows; pivots up to smallest (k) are 0.

    A component whose pivot is 0 repeats those before it, so that it is the first one that counts. Definiteness
    is not judged.
    """
    k = len(S)
    rest, L, D = S.copy(), np.eye(k), np.zeros(k)
    for j in range(k):
        pivot = rest[j, j]
        if pivot > smallest[j]:
            D[j], L[j + 1 :, j] = pivot, rest[j + 1 :, j] / pivot
            rest[j + 1 :, j + 1 :] -= np.outer(rest[j + 1 :, j], rest[j + 1 :, j]) / pivot
    return Pivots(L, D)


def downdated(S: Matrix, w: Vector, errors: Vector) -> tuple[Matrix, bool]:
    """The lower S' with S' S'^T = S S^T - w w^T, and whether a pivot of it was nothing but rounding, and made 0.

    The rank-one downdate of van der Merwe & Wan 2001 (Golub & Van Loan 2013, section 6.5.4): r^2 = S_jj^2 -
    w_j^2, c = r / S_jj, s = w_j / S_jj, S_ij <- (S_ij - s w_i) / c, w_i <- c w_i - s S_ij. A component of w
    within its rounding errors (n) is none: so a zero pivot from which nothing is taken stays as it is. Raises
    NOT_POSITIVE.
    """
    n = len(S)
    S, w = S.copy(), w.copy()
    gone = False
    for j in range(n):
        if abs(w[j]) <= errors[j]:
            continue
        square, limit = S[j, j] ** 2 - w[j] ** 2, 8.0 * n * EPS * S[j, j] ** 2
        if square < -limit:
            raise StepError(Status.NOT_POSITIVE)
        if square <= limit:
            S[j:, j] = 0.0
            w[j:] = 0.0
            gone = True
            continue
        r = np.sqrt(square)
        c, s = r / S[j, j], w[j] / S[j, j]
        S[j, j] = r
        S[j + 1 :, j] = (S[j + 1 :, j] - s * w[j + 1 :]) / c
        w[j + 1 :] = c * w[j + 1 :] - s * S[j + 1 :, j]
    return S, gone
