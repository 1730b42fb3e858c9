"""Small symmetric matrices of constants: whether they are symmetric and positive semidefinite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath

from kfgen.spec.operations import Value, real

Rows = Sequence[Sequence[Value]]
_DIGITS = 40
# Of entries scaled to correlations: rounded decimals may leave a singular matrix this far below 0.
_TOLERANCE = 1e-9


def close(a: Value, b: Value, scale: Value = 0) -> bool:
    """Equal up to rounding, relative to the larger (or to a scale)."""
    with mpmath.workdps(_DIGITS):
        a, b = real(a), real(b)
        return bool(abs(a - b) <= _TOLERANCE * max(abs(a), abs(b), abs(real(scale))))


def is_semidefinite(rows: Rows) -> bool:
    """Whether a symmetric matrix is positive semidefinite, up to rounding."""
    with mpmath.workdps(_DIGITS):
        a = [[real(entry) for entry in row] for row in rows]
        size = len(a)
        if any(a[i][i] < 0 for i in range(size)):
            return False
        roots = [mpmath.sqrt(a[i][i]) for i in range(size)]
        for i in range(size):
            for j in range(size):
                if roots[i] == 0 or roots[j] == 0:
                    if a[i][j] != 0:
                        return False
                else:
                    a[i][j] = a[i][j] / (roots[i] * roots[j])
        return _eliminate(a)


def worst_pair(rows: Rows) -> tuple[int, int] | None:
    """The pair whose correlation is farthest beyond 1, of a symmetric matrix.

    None where there is none, or a variance is negative: then it takes more than two to break it.
    """
    with mpmath.workdps(_DIGITS):
        a = [[real(entry) for entry in row] for row in rows]
        if any(a[i][i] < 0 for i in range(len(a))):
            return None
        found, worst = None, mpmath.mpf(1 + _TOLERANCE)
        for i in range(len(a)):
            for j in range(i + 1, len(a)):
                product = mpmath.sqrt(a[i][i] * a[j][j])
                beyond = abs(a[i][j]) / product if product else mpmath.inf if a[i][j] else 0
                if beyond > worst:
                    found, worst = (i, j), beyond
        return found


def _eliminate(a: list[list[Any]]) -> bool:
    """Cholesky with the largest pivot first, of a matrix of correlations."""
    left = [i for i in range(len(a)) if a[i][i] != 0]
    while left:
        pivot = max(left, key=lambda i: a[i][i])
        if a[pivot][pivot] <= 10 * _TOLERANCE:
            return all(abs(a[i][j]) <= 10 * _TOLERANCE for i in left for j in left)
        left.remove(pivot)
        for i in left:
            factor = a[i][pivot] / a[pivot][pivot]
            for j in left:
                a[i][j] -= factor * a[pivot][j]
    return True


def smallest_eigenvalue(rows: Rows) -> Value:
    """For messages; None where the matrix is so large that computing it would take long."""
    if len(rows) > 24:
        return None
    with mpmath.workdps(25):
        matrix = mpmath.matrix([[real(entry) for entry in row] for row in rows])
        return min(mpmath.eigsy(matrix, eigvals_only=True))
