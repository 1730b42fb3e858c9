"""Factors of symmetric matrices: U D U^T, roots, and what is read off them."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.filters.algebra import swept
from kfgen.filters.algebra.linalg import Rows, Vector, dot, minus, times, zeros
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_negligible,
    is_positive,
    is_zero,
    reciprocal,
    require_no_column,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.sweep import Matrix, Unrolled
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.ir.trace import Value


def udu(P: Rows) -> tuple[Rows, Vector]:
    """U, D of a symmetric positive semidefinite matrix (upper triangle read). A zero pivot gives a zero column."""
    n = len(P)
    P = [list(row) for row in P]
    U = zeros(n, n)
    D: Vector = [0] * n
    scale = [P[j][j] for j in range(n)]
    for j in reversed(range(n)):
        D[j] = P[j][j]
        if is_zero(D[j]) or is_negligible(D[j], scale[j]):
            D[j] = 0
            continue
        if not is_positive(D[j]):
            for i in range(j):
                require_no_column(D[j], P[i][j], scale[i], scale[j])
        _eliminate(P, U, D, j)
    return U, D


def udu_computed(P: Rows, smallest: Number) -> tuple[Rows, Vector]:
    """The same of a matrix that is positive semidefinite but for rounding: pivots are at least smallest P_jj."""
    n = len(P)
    P = [list(row) for row in P]
    U = zeros(n, n)
    D: Vector = [0] * n
    scale = [P[j][j] for j in range(n)]
    for j in reversed(range(n)):
        if is_zero(scale[j]):
            continue
        least = scale[j] * smallest
        D[j] = assume_nonnegative(P[j][j] if j == n - 1 else select(P[j][j] > least, P[j][j], least))
        _eliminate(P, U, D, j)
    return U, D


def _eliminate(P: Rows, U: Rows, D: Vector, j: int) -> None:
    """Column j of U from that of P, which is what D_j leaves of the matrix; P less its outer product."""
    inverse = 1 / D[j] if is_positive(D[j]) else reciprocal(D[j])[1]
    for i in range(j):
        U[i][j] = times(P[i][j], inverse)
    for i in range(j):
        for k in range(i + 1):
            if not is_zero(U[i][j]) and not is_zero(P[k][j]):
                P[k][i] = P[k][i] - U[i][j] * P[k][j]


def gram_schmidt(rows: Rows, weights: Vector) -> tuple[Rows, Vector]:
    """U, D with U D U^T = W diag(weights) W^T by modified weighted Gram-Schmidt (Thornton 1976; Bierman 1977, VI.4).

    rows: W (n, m); weights (m,), none negative.
    """
    n = len(rows)
    W = [list(row) for row in rows]
    U = zeros(n, n)
    D: Vector = [0] * n
    for j in reversed(range(n)):
        weighted = [times(x, d) for x, d in zip(W[j], weights, strict=True)]
        D[j] = assume_nonnegative(dot(weighted, W[j]))
        if is_zero(D[j]):
            continue
        inverse = 1 / D[j] if is_positive(D[j]) else reciprocal(D[j])[1]
        for i in range(j):
            U[i][j] = u = times(dot(weighted, W[i]), inverse)
            W[i] = [minus(a, times(u, c)) for a, c in zip(W[i], W[j], strict=True)]
    return U, D


def cholesky(P: Callable[[int, int], Value], n: int, tolerance: Fraction) -> tuple[Rows, list[Value]]:
    """The lower root S of P (n, n) with S S^T = P, and conditions under which a variance is negative.

    A pivot up to `tolerance` of its diagonal is a direction without spread: a zero column; so is one that is negative,
    which round-off may make by any amount where a variance is small beside what it has been.
    """
    S: Rows = [[0] * n for _ in range(n)]
    failures: list[Value] = []
    for j in range(n):
        diagonal = P(j, j)
        pivot = diagonal - dot(S[j][:j], S[j][:j]) if j else diagonal
        if is_zero(pivot):
            continue
        limit = diagonal * tolerance
        failures.append(~(diagonal >= 0))
        some = pivot > limit
        root = sqrt(select(some, pivot, 0))
        S[j][j] = assume_nonnegative(root)
        inverse = select(some, 1 / root, 0)
        for i in range(j + 1, n):
            S[i][j] = times(minus(P(j, i), dot(S[i][:j], S[j][:j])), inverse)
    return S, failures


def root_of_factors(U: Rows, D: Vector) -> Rows:
    """U sqrt(D)."""
    n = len(D)
    out: Rows = [[0] * n for _ in range(n)]
    for j in range(n):
        root = D[j] if is_zero(D[j]) else sqrt(D[j])
        for i in range(j):
            out[i][j] = times(U[i][j], root)
        out[j][j] = root
    return out


def columns_of(rows: Rows) -> list[Vector]:
    """The columns of an upper triangular matrix, as full vectors."""
    n = len(rows)
    return [[rows[i][j] if i <= j else 0 for i in range(n)] for j in range(n)]


def factor_columns(U: Rows, D: Vector) -> list[tuple[Vector, Number]]:
    """The columns of a unit upper triangular U with their weights."""
    n = len(D)
    return [([*(U[i][j] for i in range(j)), 1, *[0] * (n - j - 1)], D[j]) for j in range(n)]


def indefinite(P: Symmetric, tolerance: Fraction) -> list[Value]:
    """Conditions under which a pivot of P is negative by more than rounding leaves."""
    n = P.n
    failures: list[Value] = []
    dense: Rows = [[P[i, j] for j in range(n)] for i in range(n)]
    rest = Matrix([list(row) for row in dense])
    swept.indefinite(Unrolled(), n, Matrix(dense), rest, 8 * tolerance, failures.append)
    return failures


def solved(U: Rows, D: Vector, c: Vector, smallest: Vector) -> Vector:
    """(U D U^T)^-1 c; an entry is 0 where D is not above `smallest`."""

    def inverse(j: int) -> Number:
        some, plain = reciprocal(assume_nonnegative(D[j]))
        return plain if is_zero(smallest[j]) else select(some & (D[j] > smallest[j]), 1 / D[j], 0)

    v: Vector = list(c)
    swept.solve(Unrolled(), len(D), Matrix(U), v, inverse)
    return v
