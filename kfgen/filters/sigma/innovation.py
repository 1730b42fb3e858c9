"""The covariance of an innovation, S = L D L^T in the order of the components: what counts in it, and what is left."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector, times
from kfgen.filters.algebra.numbers import Number, assume_positive, is_zero, select
from kfgen.ir.trace import Trace, Value


@dataclass(frozen=True)
class Factored:
    """S = L D L^T and what belongs to it: nu = L^-1 y, the columns of Pxz L^-T (m, n), 1 / D or 0, D or 1.

    pivots: D as it comes out. share: what is at least left of every variance: the product of r_k / d_k, r_k the pivots
    of R.
    """

    nu: Vector
    columns: list[Vector]
    inverse: Vector
    D: Vector
    pivots: Vector
    some: list[Value | None]  # whether D counts; None: it does
    failures: list[Value]
    nis: Value
    share: Value


@dataclass(frozen=True)
class Trust:
    """What is known of S: sure: that every S_jj is positive; definite: that it is positive semidefinite. tolerance: a
    pivot up to m times this part of S_jj is none. noise: what rounding may leave of each variance (m,)."""

    sure: bool
    definite: bool
    tolerance: Fraction
    noise: Vector


def factored(t: Trace, names: list[str], y: Vector, S: Rows, R: Rows, cross: Rows, trust: Trust) -> Factored:
    """The factors of S = R + ..., in the order of the components."""
    m, n = len(y), len(cross)
    rest = [list(row) for row in S]
    nu = list(y)
    columns: list[Vector] = [[cross[i][a] for i in range(n)] for a in range(m)]
    D: Vector = []
    found: Vector = []
    inverse: Vector = []
    some: list[Value | None] = []
    failures: list[Value] = []
    nis: Value = t.zero
    share: Number = 1
    noises = pivots(R, trust.tolerance * m)
    for j in range(m):
        pivot = t.name(rest[j][j], f"s_{names[j]}")
        found.append(pivot)
        counts: Value | None = None
        if trust.sure and rest[j][j].node is S[j][j].node:  # not correlated with those before it
            failures.append(~(pivot > 0))
            inverse.append(1 / assume_positive(pivot))
            D.append(pivot)
        else:
            limit = S[j][j] * (trust.tolerance * m) + trust.noise[j]
            if not trust.definite:  # else it can only be round-off
                failures.append(~(pivot >= -limit))
            counts = pivot > limit if trust.sure else (pivot > limit) & (pivot > t.smallest)
            inverse.append(select(counts, 1 / pivot, 0))
            D.append(assume_positive(select(counts, pivot, 1)))
            columns[j] = [select(counts, c, 0) for c in columns[j]]
        some.append(counts)
        left = times(noises[j], inverse[j])
        share = times(share, left if counts is None else select(counts, left, 1))
        for i in range(j + 1, m):
            factor = rest[j][i] * inverse[j]
            for k in range(i, m):
                rest[i][k] = rest[i][k] - factor * rest[j][k]
            nu[i] = nu[i] - factor * nu[j]
            columns[i] = [linalg.minus(c, times(factor, b)) for c, b in zip(columns[i], columns[j], strict=True)]
        nis = nis + nu[j] * (nu[j] * inverse[j])
    return Factored(nu, columns, inverse, D, found, some, failures, nis, t.value(share))


def pivots(R: Rows, tolerance: Fraction) -> Vector:
    """Those of R in the order of the components; 0 up to `tolerance` of R_jj."""
    rest = [list(row) for row in R]
    out: Vector = []
    for j, row in enumerate(rest):
        alone = all(is_zero(R[j][i]) for i in range(j))
        out.append(row[j] if alone else select(row[j] > R[j][j] * tolerance, row[j], 0))
        for i in range(j + 1, len(R)):
            if is_zero(row[i]):
                continue
            factor = row[i] * select(out[j] > 0, 1 / select(out[j] > 0, out[j], 1), 0)
            for k in range(i, len(R)):
                rest[i][k] = linalg.minus(rest[i][k], times(factor, row[k]))
    return out


def known_squares(t: Trace, y: Vector, S: Rows, D: Vector, some: list[Value | None], known: Fraction) -> Value:
    """y^T S^-1 y over the pivots of S that are above `known` of the entries of D."""
    m = len(y)
    rest = [list(row) for row in S]
    nu = list(y)
    total: Value = t.zero
    for j in range(m):
        pivot = rest[j][j]
        counts = pivot > D[j] * known
        choice = some[j]
        if choice is not None:
            counts = counts & choice
        inverse = select(counts, 1 / pivot, 0)
        for i in range(j + 1, m):
            factor = rest[j][i] * inverse
            for k in range(i, m):
                rest[i][k] = rest[i][k] - factor * rest[j][k]
            nu[i] = nu[i] - factor * nu[j]
        total = total + nu[j] * (nu[j] * inverse)
    return total
