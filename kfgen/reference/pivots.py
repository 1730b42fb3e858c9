"""Covariances that are positive but for round-off: what of it counts as 0, and their factors.

A pivot up to 8 n eps of its diagonal is 0, and so is what is negative within that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import EPS
from kfgen.reference.status import Status, StepError


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
    def matrix(self) -> Matrix:
        """S (k, k)."""
        S: Matrix = (self.L * self.D) @ self.L.T
        return S

    def squares(self, y: Vector) -> Vector:
        """The terms (k) whose sum is y^T S^-1 y."""
        terms: Vector = np.linalg.solve(self.L, y) ** 2 * self.inverse
        return terms

    def gain(self, cross: Matrix) -> Matrix:
        """cross S^-1 (n, k)."""
        whitened = np.linalg.solve(self.L, cross.T) * self.inverse[:, None]
        gain: Matrix = np.asarray(np.linalg.solve(self.L.T, whitened), dtype=np.float64).T
        return gain


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


def bounded(P: Matrix, least: Vector) -> Matrix:
    """P (n, n) with variances of at least 0, up to `least` (n) 0, and then with |P_ij| <= sqrt(P_ii P_jj) = 0."""
    low = P.diagonal() <= least
    if not np.any(low):
        return P
    P = P.copy()
    P[low, :] = 0.0
    P[:, low] = 0.0
    return P


def judge(P: Matrix, size: Vector) -> None:
    """Raises NOT_POSITIVE where P (n, n), gathered with negative weights, is indefinite by more than the rounding
    of its terms, whose absolute values add up to `size` (n) on the diagonal."""
    scale = np.sqrt(np.where(size > 0.0, size, 1.0))
    if np.linalg.eigvalsh(P / np.outer(scale, scale))[0] < -8.0 * len(P) * EPS:
        raise StepError(Status.NOT_POSITIVE)


def downdated(S: Matrix, w: Vector, smallest: Vector, definite: bool = False) -> tuple[Matrix, bool]:
    """The lower S' with S' S'^T = S S^T - w w^T, and whether a pivot of it was nothing but rounding, and made 0.

    The rank-one downdate of van der Merwe & Wan 2001 (Golub & Van Loan 2013, section 6.5.4): r^2 = S_jj^2 -
    w_j^2, c = r / S_jj, s = w_j / S_jj, S_ij <- (S_ij - s w_i) / c, w_i <- c w_i - s S_ij. A component of w
    up to `smallest` (n) is none: so a zero pivot from which nothing is taken stays as it is. Raises NOT_POSITIVE,
    unless it is known to be definite, so that only rounding can say otherwise.
    """
    n = len(S)
    S, w = S.copy(), w.copy()
    gone = False
    for j in range(n):
        if abs(w[j]) <= smallest[j]:
            continue
        square, limit = S[j, j] ** 2 - w[j] ** 2, 8.0 * n * EPS * S[j, j] ** 2
        if square < -limit and not definite:
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
