"""Factored linear algebra, written once for any number-like type (see `numbers`).

P = U D U^T, U unit upper triangular. A matrix is a list of rows; of U only the entries above the diagonal
are looked at. Every function is exact in real arithmetic; what is structurally zero is not computed.
"""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    assume_positive,
    is_negligible,
    is_one,
    is_positive,
    is_zero,
    reciprocal,
    require_no_column,
    select,
)  # fmt: skip

Vector = list[Number]
Rows = list[list[Number]]


@dataclass(frozen=True)
class Measurement:
    """A scalar measurement: its row h (n,), its variance r, and its weight g, 1 but for robust updates.

    An update with it makes s = r + g h P h^T, K = P h^T / s, P - g K s K^T. nu, moved: the innovation, and what
    earlier ones have moved the state by, for layouts that apply the gain themselves.
    """

    h: Vector
    r: Number
    g: Number = 1
    nu: Number = None
    moved: Vector | None = None


def plus(a: Number, b: Number) -> Number:
    """a + b, also where one of them is a structural zero of Python's."""
    return b if is_zero(a) else a if is_zero(b) else a + b


def minus(a: Number, b: Number) -> Number:
    """a - b, likewise."""
    return a if is_zero(b) else -b if is_zero(a) else a - b


def times(a: Number, b: Number) -> Number:
    """a b, also where one of them is a structural zero or one of Python's."""
    if is_zero(a) or is_zero(b):
        return 0
    return b if is_one(a) else a if is_one(b) else a * b


def dot(a: Vector, b: Vector) -> Number:
    """Sum of a_i b_i, without the terms that are zero."""
    total: Number = 0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def zeros(rows: int, columns: int) -> Rows:
    return [[0] * columns for _ in range(rows)]


def unit_columns(F: Rows, U: Rows, k: int) -> Vector:
    """Column k of F U for U unit upper triangular. F: (n, n); returns (n,)."""
    n = len(F)
    out: Vector = []
    for i in range(n):
        column = [U[j][k] if j < k else 1 if j == k else 0 for j in range(n)]
        out.append(dot(F[i], column))
    return out


def rank_one(U: Rows, D: Vector, columns: list[tuple[Vector, Number, int]], safe: bool = False) -> None:
    """U D U^T += sum of d w w^T over the columns (w, d, own), in place (Agee & Turner 1972; Bierman 1977, V.3).

    The columns take one pivot after another together, so that an element of U is fetched once for all of
    them. `own` is the pivot where a column carries most weight (-1: none): there U <- t U + b w is used for
    U + b (w - s U), which loses digits where D is far below d s^2; so it is where D may be as good as zero, and
    everywhere if `safe`.
    """
    W = [list(w) for w, _, _ in columns]
    weights = [d for _, d, _ in columns]
    for j in reversed(range(len(D))):
        steps = []
        # a pivot that may be zero starts with its own column: from another, that may hardly reach it, it would take a U
        # without bounds, to which the next one loses its digits
        first = sorted(range(len(W)), key=lambda c: columns[c][2] != j) if not is_positive(D[j]) else range(len(W))
        for c in first:
            w = W[c]
            if not is_zero(weights[c]) and not is_zero(w[j]):
                careful = safe or columns[c][2] == j or not is_positive(D[j])
                s, b, t, D[j], weights[c] = _pivot(D[j], w[j], weights[c])
                steps.append((w, s, b, t, careful))
        for i in range(j):
            for w, s, b, t, own in steps:
                U[i][j], w[i] = _element(U[i][j], w[i], s, b, t, own)


def _pivot(D: Number, s: Number, d: Number) -> tuple[Number, Number, Number, Number, Number]:
    """s, b, t, the new D of a pivot, and the weight that is left for the pivots above.

    D' = D + d s^2, b = d s / D', t = D / D', d' = d t.
    """
    v = times(d, s)
    fresh = is_zero(D)
    a = v * s if fresh else D + s * v
    if fresh and is_one(s):
        return s, 1, 0, a, 0  # whatever d is: a direction without variance takes any U
    if fresh and is_positive(a):
        return s, 1 / s, 0, assume_positive(a), 0
    if is_positive(D) or is_positive(a):
        r = 1 / assume_positive(a)
        b, t = v * r, D * r
        return s, b, t, a, d * t
    # A zero pivot leaves the column to the pivots above. Quotients, since 1/a may overflow where they do not.
    some = assume_nonnegative(a) > 0
    b = select(some, v / a, 0)
    if fresh:
        return s, b, 1, a, select(some, 0, d)
    t = select(some, D / a, 1)
    return s, b, t, a, d * t


def _element(u: Number, w: Number, s: Number, b: Number, t: Number, own: bool) -> tuple[Number, Number]:
    """The new U_ij and w_i at pivot j."""
    if is_zero(w) and is_zero(u):
        return u, w
    if is_zero(t):  # the pivot had no variance of its own: its column becomes w / s
        return b * w, 0
    if is_zero(u):
        return b * w, w
    if own:  # U first: w is then free to be overwritten
        new = t * u if is_zero(w) else t * u + b * w
        return new, (-(s * u) if is_zero(w) else w - s * u)
    left = -(s * u) if is_zero(w) else w - s * u
    return u + b * left, left


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
            b, D[j], s[c] = _gain(D[j], f, weighted, s[c])
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
    n = len(D)
    v: Vector = list(c)  # U^-1 c = D f
    for j in reversed(range(n)):
        for i in range(j):
            v[i] = minus(v[i], times(U[i][j], v[j]))
    if smallest is not None:
        v = [select(d > low, x, 0) for x, d, low in zip(v, D, smallest, strict=True)]
    f = [times(x, 1 / d if is_positive(d) else reciprocal(d)[1]) for x, d in zip(v, D, strict=True)]
    r = s - dot(f, v)
    failed = ~(r >= -(s * tolerance))
    gone = r < 0
    before = assume_nonnegative(select(gone, 0, r))
    k: Vector = [0] * n
    for j in range(n):
        if is_zero(v[j]):
            continue
        after = before + f[j] * v[j]
        some, inverse = reciprocal(assume_nonnegative(after))
        b = times(v[j], inverse)
        for i in range(j):
            old = U[i][j]
            U[i][j] = minus(old, times(f[j], k[i]))
            k[i] = plus(k[i], times(b, U[i][j]))
        k[j] = b
        D[j] = assume_nonnegative(D[j] * select(some, before * inverse, 1))
        before = after
    return failed, gone


def _gain(D: Number, f: Number, weighted: Number, before: Number) -> tuple[Number, Number, Number]:
    """b, the new D and s of one column: s = before + g f^2 D, b = D f / s, D' = D before / s. weighted: g f."""
    v = D if is_one(f) else D * f
    s = before + weighted * v
    if is_positive(before):
        assume_positive(s)
        inverse = 1 / s
        return v * inverse, assume_nonnegative(D * (before * inverse)), s
    some, inverse = reciprocal(assume_nonnegative(s))
    return v * inverse, assume_nonnegative(D * select(some, before * inverse, 1)), s


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
        inverse = 1 / D[j] if is_positive(D[j]) else reciprocal(D[j])[1]
        for i in range(j):
            U[i][j] = times(P[i][j], inverse)
        for i in range(j):
            for k in range(i + 1):
                if not is_zero(U[i][j]) and not is_zero(P[k][j]):
                    P[k][i] = P[k][i] - U[i][j] * P[k][j]
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
        inverse = 1 / D[j] if is_positive(D[j]) else reciprocal(D[j])[1]
        for i in range(j):
            U[i][j] = times(P[i][j], inverse)
        for i in range(j):
            for k in range(i + 1):
                if not is_zero(U[i][j]) and not is_zero(P[k][j]):
                    P[k][i] = P[k][i] - U[i][j] * P[k][j]
    return U, D


def quotients(c: Vector, s: Number, r: Number) -> Vector:
    """c / s, and 0 where s is 0, for s = r + something not negative."""
    inverse = 1 / s if is_positive(r) else reciprocal(s)[1]
    return [times(x, inverse) for x in c]
