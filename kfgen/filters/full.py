"""Covariance kept as the upper triangle of P, column by column."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters import linalg
from kfgen.filters.base import Block
from kfgen.filters.linalg import Rows, Vector
from kfgen.filters.numbers import is_positive, is_zero, select, sqrt
from kfgen.filters.ud import triangle
from kfgen.ir.trace import Array, Trace, Value


def packed(i: int, j: int) -> int:
    """Position of P_ij, i <= j."""
    return j * (j + 1) // 2 + i


class Full:
    """Layout `full`, with the updates `joseph` and `standard`. A covariance is its rows; only i <= j is used."""

    reorders = False

    def __init__(self, n: int, update: str, epsilon: Fraction) -> None:
        self.n = n
        self.form = update
        self.epsilon = epsilon

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        flat = tuple(P0[i][j] for j in range(self.n) for i in range(j + 1))
        return [Block("P", len(flat), "covariance, upper triangle column by column", initial=flat)]

    def load(self, t: Trace) -> Rows:
        n = self.n
        return [[t.element("kf.P", packed(min(i, j), max(i, j))) for j in range(n)] for i in range(n)]

    def predict(self, t: Trace, P: Rows, F: Rows, Q: Rows, noise: list[tuple[Vector, Value]]) -> Rows:
        """P <- F P F^T + Q + sum of d w w^T over the noise columns (w, d)."""
        t.section("P = F P F^T + Q")
        out = linalg.triple(F, P)
        for i in range(self.n):
            for j in range(i, self.n):
                if not is_zero(Q[i][j]):
                    out[i][j] = out[i][j] + Q[i][j]
                for w, d in noise:
                    if not is_zero(w[i]) and not is_zero(w[j]):
                        out[i][j] = out[i][j] + w[i] * d * w[j]
        return out

    def update(self, t: Trace, P: Rows, rows: Rows, variances: Vector) -> tuple[Rows, Vector]:
        """Update P in place by scalar measurements; returns the gains (m, n) and innovation variances (m,)."""
        gains, s = [], []
        for h, r in zip(rows, variances, strict=True):
            c = linalg.column(P, h)
            variance = linalg.dot(h, c) + r
            K = linalg.quotients(c, variance, r)
            if self.form == "joseph":
                self._joseph(P, h, r, c, K)
            else:
                self._subtract(P, K, c)
            if not is_positive(r):
                self._clamp(t, P, K, c)
            gains.append(K)
            s.append(variance)
        return gains, s

    def _subtract(self, P: Rows, K: Vector, c: Vector) -> None:
        """P - K s K^T, with s K = c."""
        for i in range(self.n):
            for j in range(i, self.n):
                if not is_zero(K[i]) and not is_zero(c[j]):
                    P[i][j] = P[j][i] = P[i][j] - K[i] * c[j]

    def _joseph(self, P: Rows, h: Vector, r: Value, c: Vector, K: Vector) -> None:
        """(I - K h) P (I - K h)^T + r K K^T for any gain: A = (I - K h) P, then A - (A h^T - r K) K^T."""
        n = self.n
        A = [[P[i][j] if is_zero(K[i]) or is_zero(c[j]) else P[i][j] - K[i] * c[j] for j in range(n)] for i in range(n)]
        g = [linalg.dot(A[i], h) for i in range(n)]
        g = [x if is_zero(k) else k * r if is_zero(x) else k * r - x for x, k in zip(g, K, strict=True)]
        for i in range(n):
            for j in range(i, n):
                P[i][j] = P[j][i] = A[i][j] if is_zero(g[i]) or is_zero(K[j]) else A[i][j] + g[i] * K[j]

    def _clamp(self, t: Trace, P: Rows, K: Vector, c: Vector) -> None:
        """A variance that an exact measurement took to zero may come out below it by round-off: back to zero."""
        for i in range(self.n):
            if is_zero(K[i]):
                continue
            old = P[i][i] + K[i] * c[i]
            low = (P[i][i] < 0) & (P[i][i] >= -(old * (4 * self.n * self.epsilon)))
            t.flag(low, "REGULARIZED")
            P[i][i] = select(low, 0, P[i][i])

    def tolerance(self, P: Rows, h: Vector) -> Value | int:
        """How far below zero h P h^T may come out by round-off."""
        terms = [(hi * hi * P[i][i]) for i, hi in enumerate(h) if not is_zero(hi)]
        return sum(terms[1:], terms[0]) * (4 * self.n * self.epsilon) if terms else 0

    def limit(self, t: Trace, P: Rows, floors: list[Fraction | None], ceilings: list[Fraction | None]) -> None:
        """variance_floor raises P_ii; variance_ceiling scales row and column i down."""
        for i, low in enumerate(floors):
            if low is not None:
                t.flag(P[i][i] < low, "REGULARIZED")
                P[i][i] = select(P[i][i] < low, t.value(low), P[i][i])
        for i, high in enumerate(ceilings):
            if high is not None:
                above = P[i][i] > high
                t.flag(above, "REGULARIZED")
                scale = select(above, sqrt(high / P[i][i]), 1)
                for j in range(self.n):
                    if j != i:
                        P[i][j] = P[j][i] = P[i][j] * scale
                P[i][i] = select(above, t.value(high), P[i][i])

    def evidence(self, P: Rows, after_predict: bool) -> list[Value]:
        """The diagonal: |P_ij| <= max(P_ii, P_jj), and their products bound those off the diagonal."""
        return [P[i][i] for i in range(self.n)]

    def store(self, t: Trace, P: Rows, names: list[str]) -> None:
        for j in range(self.n):
            for i in range(j + 1):
                t.store("kf.P", packed(i, j), t.name(P[i][j], f"p_{names[i]}_{names[j]}"))

    # covariance in and out, as loops -------------------------------------------------------------------

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j."""
        return t.element("kf.P", triangle(j) + j + i)

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store a covariance (upper triangle column by column) whose factors are known to be positive."""
        with t.loop("k", 0, self.n * (self.n + 1) // 2) as k:
            t.store("kf.P", k, P[k])
