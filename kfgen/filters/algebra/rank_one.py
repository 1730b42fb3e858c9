"""Rank-one updates of U D U^T, U unit upper triangular: columns absorbed one pivot after another.

Of U only the entries above the diagonal are looked at. Exact in real arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.filters.algebra.linalg import Rows, Vector, dot, times
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    assume_positive,
    is_one,
    is_positive,
    is_zero,
    select,
)  # fmt: skip


def unit_columns(F: Rows, U: Rows, k: int) -> Vector:
    """Column k of F U for U unit upper triangular. F: (n, n); returns (n,)."""
    n = len(F)
    out: Vector = []
    for i in range(n):
        column = [U[j][k] if j < k else 1 if j == k else 0 for j in range(n)]
        out.append(dot(F[i], column))
    return out


def neighbours(T: Rows) -> list[list[int]] | None:
    """The blocks of neighbouring states outside of which T is the identity; None: they are no neighbours."""
    blocks: list[list[int]] = []
    for i, row in enumerate(T):
        block = [j for j, v in enumerate(row) if j == i or not is_zero(v)]
        if block == [i] and is_one(row[i]):
            continue
        if block != list(range(block[0], block[-1] + 1)):
            return None
        if block not in blocks:
            blocks.append(block)
    return blocks


def turned_block(U: Rows, D: Vector, T: Rows, block: Sequence[int]) -> None:
    """U D U^T <- T U D U^T T^T in place, T regular in a block of neighbouring states, the identity elsewhere: columns
    after the block are turned, those of the block take its pivots, of which as many as columns leave nothing."""
    n, first = len(D), block[0]
    for k in range(block[-1] + 1, n):
        above = [U[j][k] for j in block]
        for i in block:
            U[i][k] = dot([T[i][j] for j in block], above)
    columns = [(unit_columns(T, U, k), D[k], k) for k in block]
    for k in block:
        D[k] = 0
        for i in range(k):
            U[i][k] = 0
    rank_one(U, D, columns, lowest=first, highest=block[-1])


def rank_one(
    U: Rows, D: Vector, columns: list[tuple[Vector, Number, int]], safe: bool = False, lowest: int = 0,
    highest: int | None = None,
) -> None:  # fmt: skip
    """U D U^T += sum of d w w^T over the columns (w, d, own), in place (Agee & Turner 1972; Bierman 1977, V.3).

    The columns take one pivot after another together, so that an element of U is fetched once for all of
    them. `own` is the pivot where a column carries most weight (-1: none): there U <- t U + b w is used for
    U + b (w - s U), which loses digits where D is far below d s^2; so it is where D may be as good as zero, and
    everywhere if `safe`. lowest, highest: the pivots that they reach.
    """
    W = [list(w) for w, _, _ in columns]
    weights = [d for _, d, _ in columns]
    for j in reversed(range(lowest, len(D) if highest is None else highest + 1)):
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
