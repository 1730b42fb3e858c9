"""Dense textbook linear algebra on positive semidefinite matrices.

Every function takes and returns float64 arrays; "zero" is always meant relative to the matrix at hand.
"""

from __future__ import annotations

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.status import Status, StepError

EPS = float(np.finfo(np.float64).eps)


def symmetric(P: Matrix) -> Matrix:
    """The symmetric part (P + P^T) / 2."""
    half: Matrix = 0.5 * (P + P.T)
    return half


def udu(P: Matrix, computed: bool = True) -> tuple[Matrix, Vector]:
    """P = U diag(D) U^T with U unit upper triangular (n, n) and D >= 0 (n).

    Bierman 1977, section III.3, from the last column to the first; a zero pivot has a zero column.

    An indefinite matrix raises NOT_POSITIVE. One that was given has to satisfy the pivots themselves: below
    -n eps P_jj is indefinite, up to n eps P_jj is 0, and the column above a zero pivot must vanish to
    sqrt(n eps P_ii P_jj). One that was computed carries rounding errors, which elimination amplifies: it is
    judged by the eigenvalues of its correlations, and pivots up to 8 n eps P_jj are 0.
    """
    n = len(P)
    zero = 8.0 * n * EPS if computed else n * EPS
    if np.count_nonzero(P) == np.count_nonzero(P.diagonal()):  # which most R are: nothing is eliminated
        pivots = P.diagonal()
        if (pivots < 0.0).any():
            raise StepError(Status.NOT_POSITIVE)
        return np.eye(n), np.where(pivots > zero * pivots, pivots, 0.0)
    rest = np.triu(P) + np.triu(P, 1).T
    scale = rest.diagonal().copy()
    if computed:
        _judge(rest)
    U, D = np.eye(n), np.zeros(n)
    for j in range(n - 1, -1, -1):
        pivot, column = rest[j, j], rest[:j, j].copy()
        if pivot > zero * scale[j]:
            D[j], U[:j, j] = pivot, column / pivot
            rest[:j, :j] -= np.outer(column, column) / pivot
        elif not computed:
            allowed = np.sqrt(zero * np.abs(scale[:j]) * abs(scale[j]))
            if pivot < -zero * abs(scale[j]) or np.any(np.abs(column) > allowed):
                raise StepError(Status.NOT_POSITIVE)
    return U, D


def _judge(P: Matrix) -> None:
    """Raises NOT_POSITIVE unless the correlations of P are positive semidefinite to rounding."""
    variances = P.diagonal()
    if (variances < 0.0).any():
        raise StepError(Status.NOT_POSITIVE)
    if np.count_nonzero(P) == np.count_nonzero(variances):
        return
    sigma = np.sqrt(variances)
    if (P[sigma == 0.0] != 0.0).any():
        raise StepError(Status.NOT_POSITIVE)
    sigma[sigma == 0.0] = 1.0
    if np.min(np.linalg.eigvalsh(P / np.outer(sigma, sigma))) < -1e3 * len(P) * EPS:
        raise StepError(Status.NOT_POSITIVE)


def lower_root(P: Matrix) -> Matrix:
    """The lower triangular S (n, n) with S S^T = P (computed); a zero pivot gives a zero column."""
    flip = slice(None, None, -1)
    U, D = udu(P[flip, flip])
    root: Matrix = (U * np.sqrt(D))[flip, flip]
    return root


def check_covariance(P: Matrix) -> None:
    """Raises NOT_FINITE or NOT_POSITIVE unless P, computed from formulas, is a covariance."""
    if not np.isfinite(P).all():
        raise StepError(Status.NOT_FINITE)
    _judge(P)
