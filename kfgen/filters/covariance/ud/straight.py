"""U D U^T in straight-line code (Bierman 1977; Thornton 1976)."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.factors import columns_of, factor_columns, gram_schmidt, root_of_factors, solved, udu
from kfgen.filters.algebra.limits import Limits, lowered, raised
from kfgen.filters.algebra.linalg import Rows, Vector, dot, quotients, times
from kfgen.filters.algebra.measurement import Measurement, bierman, downdate
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_one, is_zero, require_nonnegative
from kfgen.filters.algebra.rank_one import rank_one, unit_columns
from kfgen.filters.algebra.symmetric import Symmetric, assembled
from kfgen.filters.algebra.triangles import strict
from kfgen.filters.covariance.gather import GatheredFactors
from kfgen.filters.covariance.loops.partly import FactorsInLoops
from kfgen.filters.covariance.motion import VectorGain
from kfgen.filters.covariance.names import entry_next
from kfgen.filters.covariance.noise import NEGATIVE, Additive
from kfgen.filters.covariance.parts import Columns, GainChange, Gatherer, Gathering, Motion, Removal, Scalar
from kfgen.filters.covariance.straight import StraightLine
from kfgen.filters.covariance.ud.store import UDStore
from kfgen.ir.trace import Array, Trace, Value

Factors = tuple[Rows, Vector]
"""U (n, n) and D (n,)."""


class StraightUD(StraightLine, UDStore):
    """The updates `bierman` and `joseph`."""

    def __init__(self, order: list[int], update: str, change: GainChange | None = None) -> None:
        super().__init__(order)
        self.form = update
        self.change = change
        # Elements of U are fetched once for a group of columns; the columns have to stay in registers.
        self.group = max(2, 40 // self.n)

    def plain(self) -> StraightUD:
        return self if self.change is None else StraightUD(self.order, self.form)

    def load(self, t: Trace) -> Factors:
        n = self.n
        U: Rows = [[t.element("kf.U", strict(i, j)) if i < j else t.zero for j in range(n)] for i in range(n)]
        D = [assume_nonnegative(t.element("kf.D", j)) for j in range(n)]
        return U, D

    def predict(self, t: Trace, P: Factors, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]
                ) -> Factors:  # fmt: skip
        """P <- F P F^T + Q + sum of d w w^T over the noise columns (w, d)."""
        U, D = P
        n = self.n
        UQ, DQ = Q.factors()
        for _, d in noise:
            require_nonnegative(d, NEGATIVE)
        identity = all(is_zero(F[i][j]) and is_one(F[i][i]) for i in range(n) for j in range(n) if i != j)
        upper = all(is_zero(F[i][j]) for i in range(n) for j in range(i)) and all(is_one(F[i][i]) for i in range(n))
        if upper:
            if not identity:
                t.section("F U, unit upper triangular as F is")
                U = [[unit_columns(F, U, j)[i] if i < j else t.zero for j in range(n)] for i in range(n)]
            columns = [([*(UQ[i][j] for i in range(j)), t.one, *[t.zero] * (n - j - 1)], DQ[j], j) for j in range(n)]
            columns = [c for c in columns if not is_zero(c[1])]
            self._absorb(t, U, D, columns + [(w, d, -1) for w, d in noise], "process noise")
            return U, D
        U1, D1 = UQ, DQ
        self._absorb(t, U1, D1, [(w, d, -1) for w, d in noise], "process noise")
        for k in range(0, n, self.group):
            part = range(k, min(k + self.group, n))
            t.section("F U D U^T F^T + Q" + ("" if n <= self.group else f", columns {k} to {part[-1]}"))
            rank_one(U1, D1, [(unit_columns(F, U, c), D[c], c) for c in part])
        return U1, D1

    def _absorb(self, t: Trace, U: Rows, D: Vector, columns: list[tuple[Vector, Value, int]], what: str) -> None:
        for k in range(0, len(columns), self.group):
            part = columns[k : k + self.group]
            t.section(what + ("" if len(columns) <= self.group else f", columns {k} to {k + len(part) - 1}"))
            rank_one(U, D, part)

    def update(self, t: Trace, P: Factors, measurements: list[Scalar], motion: Motion
               ) -> tuple[Factors, list[VectorGain]]:  # fmt: skip
        U, D = [list(row) for row in P[0]], list(P[1])
        scalars = [each.measurement for each in measurements]
        if self.form == "joseph":
            made = [self._joseph(U, D, measurement) for measurement in scalars]
        else:
            made = list(zip(*bierman(U, D, scalars), strict=True))
        gains = [VectorGain(K, s, each.innovation) for (K, s), each in zip(made, measurements, strict=True)]
        return (U, D), gains

    def _joseph(self, U: Rows, D: Vector, measurement: Measurement) -> tuple[Vector, Value]:
        """(I - g K h) P (I - g K h)^T + g r K K^T by weighted Gram-Schmidt of [(g K h - I) U | K], weights [D, g r]."""
        n = self.n
        r, g = measurement.r, measurement.g
        f, v = self._projected(U, D, measurement.h)
        s = r + times(g, dot(f, v))
        c = [dot([1] + [U[i][j] for j in range(i + 1, n)], v[i:]) for i in range(n)]
        K = quotients(c, s, r)
        if self.change is not None:
            K = self.change(K)
        weighted = [times(g, k) for k in K]
        rows = [
            [weighted[i] * f[j] - (U[i][j] if j > i else 1 if j == i else 0)
             if not is_zero(K[i]) and not is_zero(f[j])
             else -(U[i][j]) if j > i else -1 if j == i else 0 for j in range(n)] + [K[i]]
            for i in range(n)
        ]  # fmt: skip
        U1, D1 = gram_schmidt(rows, [*D, times(g, r)])
        for i in range(n):
            D[i] = D1[i]
            U[i][:] = U1[i]
        return K, s

    def _projected(self, U: Rows, D: Vector, h: Vector) -> tuple[Vector, Vector]:
        """f = U^T h^T and v = D f."""
        f = [dot([U[i][j] for i in range(j)] + [1], h[: j + 1]) for j in range(self.n)]
        return f, [fj if is_zero(fj) else d * fj for d, fj in zip(D, f, strict=True)]

    def entries(self, P: Factors) -> Symmetric:
        return assembled(*P)

    def variance(self, P: Factors, h: Vector) -> Number:
        return dot(*self._projected(*P, h))

    def inflated(self, P: Factors, a: Number) -> Factors:
        U, D = P
        return U, [times(d, a) for d in D]

    def tolerance(self, P: Factors, h: Vector) -> Value | int:
        """None: a sum of D_j f_j^2 is not negative."""
        return 0

    def limit(self, t: Trace, P: Factors, floors: Limits, ceilings: Limits, epsilon: Fraction) -> Factors:
        U, D = [list(row) for row in P[0]], list(P[1])
        for beyond in (raised(U, D, floors, epsilon), lowered(U, D, ceilings, epsilon)):
            for condition in beyond.values():
                t.flag(condition, "REGULARIZED")
        return U, D

    def evidence(self, P: Factors, after_predict: bool) -> list[Value]:
        """Values whose finiteness shows that of all of P.

        After an update none are needed beside x: a gain that has met a value that is not finite stays so. After
        a prediction every later pivot meets it, but for the columns that were absorbed last.
        """
        return list(P[1]) if after_predict or self.form == "joseph" else []

    def store(self, t: Trace, P: Factors, names: list[str], after_predict: bool) -> None:
        U, D = P
        for j in range(self.n):
            for i in range(j):
                t.store("kf.U", strict(i, j), t.name(t.value(U[i][j]), entry_next("u", names, i, j)))
        for j in range(self.n):
            t.store("kf.D", j, t.name(t.value(D[j]), entry_next("d", names, j)))

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> Factors:
        return U, D

    def from_entries(self, P: Symmetric) -> Factors:
        return udu([[P[i, j] for j in range(self.n)] for i in range(self.n)])

    def factors(self, P: Factors) -> Factors:
        return [list(row) for row in P[0]], list(P[1])

    def columns(self, P: Factors) -> list[tuple[Vector, Number]]:
        return factor_columns(*P)

    def root(self, t: Trace, P: Factors, tolerance: Fraction, stored: bool, in_loops: bool) -> Array | Columns:
        return self.root_array(t) if stored and in_loops else Columns(columns_of(root_of_factors(*P)), [])

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> Gatherer[Factors]:
        def finish(U: Rows, D: Vector) -> Factors:
            return self.from_factors(t, U, D)

        if how.in_loops:
            return FactorsInLoops(t, self.order, Q, noise, how, finish)
        return GatheredFactors(t, Q, noise, how, finish)

    def downdated(
        self, t: Trace, P: Factors, c: Vector, s: Number, how: Removal, prior: Factors
    ) -> tuple[Factors, Value]:
        U, D = [list(row) for row in P[0]], list(P[1])
        smallest = None
        if not how.sure:
            dense = self.entries(P)
            smallest = [dense[j, j] * how.tolerance for j in range(self.n)]
        failed, gone = downdate(U, D, c, s, 1024 * how.tolerance, smallest)  # the points' rounding is in c
        t.flag(gone, "REGULARIZED")
        return (U, D), failed

    def indefinite(self, P: Factors, tolerance: Fraction) -> tuple[Factors, list[Value]]:
        """Never: D is not negative."""
        return P, []

    def solved(self, t: Trace, P: Factors, columns: list[Vector], tolerance: Fraction) -> Rows:
        dense = self.entries(P)
        known = [dense[j, j] * tolerance for j in range(self.n)]  # a pivot up to it is a direction without spread
        return [solved(*P, c, known) for c in columns]
