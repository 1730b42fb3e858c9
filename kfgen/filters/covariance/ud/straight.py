"""Covariance kept as P = U D U^T: U unit upper triangular, D diagonal (Bierman 1977; Thornton 1976)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Measurement, Rows, Vector
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_one, is_zero, require_nonnegative, select
from kfgen.filters.algebra.symmetric import Symmetric, assembled
from kfgen.filters.base import Block
from kfgen.filters.covariance.base import Covariance, GainChange
from kfgen.filters.covariance.gather import columns_of, factor_columns, root_of_factors
from kfgen.filters.covariance.names import entry_next
from kfgen.filters.covariance.noise import NEGATIVE, Additive
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value


def packed(i: int, j: int) -> int:
    """Position of U_ij, i < j, in the packed array: strictly upper, column by column."""
    return j * (j - 1) // 2 + i


class UD:
    """Layout `ud`, with the updates `bierman` and `joseph`."""

    title = "U D U^T"
    reorders = True
    rolled = False
    tables: Mapping[str, tuple[int, ...]] = {}
    factored = True

    def __init__(self, order: list[int], update: str, change: GainChange | None = None) -> None:
        self.order = order
        self.n = n = len(order)
        self.form = update
        self.change = change
        # Elements of U are fetched once for a group of columns; the columns have to stay in registers.
        self.group = max(2, 40 // n)

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        n = self.n
        U, D = linalg.udu([list(row) for row in P0])
        flat = tuple(Fraction(U[i][j]) for j in range(n) for i in range(j))
        out = []
        if n > 1:
            doc = "unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i"
            out.append(Block("U", n * (n - 1) // 2, doc, initial=flat))
        out.append(Block("D", n, "diagonal factor: P = U D U^T", initial=tuple(Fraction(d) for d in D)))
        return out

    def load(self, t: Trace) -> tuple[Rows, Vector]:
        n = self.n
        U: Rows = [[t.element("kf.U", packed(i, j)) if i < j else t.zero for j in range(n)] for i in range(n)]
        D = [assume_nonnegative(t.element("kf.D", j)) for j in range(n)]
        return U, D

    def predict(self, t: Trace, P: tuple[Rows, Vector], F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]
                ) -> tuple[Rows, Vector]:  # fmt: skip
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
                U = [[linalg.unit_columns(F, U, j)[i] if i < j else t.zero for j in range(n)] for i in range(n)]
            columns = [([*(UQ[i][j] for i in range(j)), t.one, *[t.zero] * (n - j - 1)], DQ[j], j) for j in range(n)]
            columns = [c for c in columns if not is_zero(c[1])]
            self._absorb(t, U, D, columns + [(w, d, -1) for w, d in noise], "process noise")
            return U, D
        U1, D1 = UQ, DQ
        self._absorb(t, U1, D1, [(w, d, -1) for w, d in noise], "process noise")
        for k in range(0, n, self.group):
            part = range(k, min(k + self.group, n))
            t.section("F U D U^T F^T + Q" + ("" if n <= self.group else f", columns {k} to {part[-1]}"))
            linalg.rank_one(U1, D1, [(linalg.unit_columns(F, U, c), D[c], c) for c in part])
        return U1, D1

    def _absorb(self, t: Trace, U: Rows, D: Vector, columns: list[tuple[Vector, Value, int]], what: str) -> None:
        for k in range(0, len(columns), self.group):
            part = columns[k : k + self.group]
            t.section(what + ("" if len(columns) <= self.group else f", columns {k} to {k + len(part) - 1}"))
            linalg.rank_one(U, D, part)

    def update(self, t: Trace, P: tuple[Rows, Vector], measurements: list[Measurement]
               ) -> tuple[tuple[Rows, Vector], Rows, Vector]:  # fmt: skip
        """Scalar measurements one after another: P, the gains (m, n) and the innovation variances (m,)."""
        U, D = [list(row) for row in P[0]], list(P[1])
        if self.form == "joseph":
            gains, s = [], []
            for measurement in measurements:
                K, variance = self._joseph(U, D, measurement)
                gains.append(K)
                s.append(variance)
        else:
            gains, s = linalg.bierman(U, D, measurements)
        return (U, D), gains, s

    def _joseph(self, U: Rows, D: Vector, measurement: Measurement) -> tuple[Vector, Value]:
        """(I - g K h) P (I - g K h)^T + g r K K^T by weighted Gram-Schmidt of [(g K h - I) U | K], weights [D, g r]."""
        n = self.n
        r, g = measurement.r, measurement.g
        f, v = self._projected(U, D, measurement.h)
        s = r + linalg.times(g, linalg.dot(f, v))
        c = [linalg.dot([1] + [U[i][j] for j in range(i + 1, n)], v[i:]) for i in range(n)]
        K = linalg.quotients(c, s, r)
        if self.change is not None:
            K = self.change(K)
        weighted = [linalg.times(g, k) for k in K]
        rows = [
            [weighted[i] * f[j] - (U[i][j] if j > i else 1 if j == i else 0)
             if not is_zero(K[i]) and not is_zero(f[j])
             else -(U[i][j]) if j > i else -1 if j == i else 0 for j in range(n)] + [K[i]]
            for i in range(n)
        ]  # fmt: skip
        U1, D1 = linalg.gram_schmidt(rows, [*D, linalg.times(g, r)])
        for i in range(n):
            D[i] = D1[i]
            U[i][:] = U1[i]
        return K, s

    def _projected(self, U: Rows, D: Vector, h: Vector) -> tuple[Vector, Vector]:
        """f = U^T h^T and v = D f."""
        f = [linalg.dot([U[i][j] for i in range(j)] + [1], h[: j + 1]) for j in range(self.n)]
        return f, [fj if is_zero(fj) else d * fj for d, fj in zip(D, f, strict=True)]

    def entries(self, P: tuple[Rows, Vector]) -> Symmetric:
        return assembled(*P)

    def variance(self, P: tuple[Rows, Vector], h: Vector) -> Number:
        return linalg.dot(*self._projected(*P, h))

    def inflated(self, P: tuple[Rows, Vector], a: Number) -> tuple[Rows, Vector]:
        U, D = P
        return U, [linalg.times(d, a) for d in D]

    def tolerance(self, P: tuple[Rows, Vector], h: Vector) -> Value | int:
        """None: a sum of D_j f_j^2 is not negative."""
        return 0

    def limit(self, t: Trace, P: tuple[Rows, Vector], floors: list[Fraction | None], ceilings: list[Fraction | None]
              ) -> tuple[Rows, Vector]:  # fmt: skip
        """variance_floor and variance_ceiling, on D."""
        _, D = P
        for j, (low, high) in enumerate(zip(floors, ceilings, strict=True)):
            if low is not None:
                t.flag(D[j] < low, "REGULARIZED")
                D[j] = select(D[j] < low, t.value(low), D[j])
            if high is not None:
                t.flag(D[j] > high, "REGULARIZED")
                D[j] = select(D[j] > high, t.value(high), D[j])
        return P

    def evidence(self, P: tuple[Rows, Vector], after_predict: bool) -> list[Value]:
        """Values whose finiteness shows that of all of P.

        After an update none are needed beside x: a gain that has met a value that is not finite stays so. After
        a prediction every later pivot meets it, but for the columns that were absorbed last.
        """
        return list(P[1]) if after_predict or self.form == "joseph" else []

    def store(self, t: Trace, P: tuple[Rows, Vector], names: list[str], after_predict: bool) -> None:
        U, D = P
        for j in range(self.n):
            for i in range(j):
                t.store("kf.U", packed(i, j), t.name(t.value(U[i][j]), entry_next("u", names, i, j)))
        for j in range(self.n):
            t.store("kf.D", j, t.name(t.value(D[j]), entry_next("d", names, j)))

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> tuple[Rows, Vector]:
        return U, D

    def factors(self, P: tuple[Rows, Vector]) -> tuple[Rows, Vector]:
        return [list(row) for row in P[0]], list(P[1])

    def columns(self, P: tuple[Rows, Vector]) -> list[tuple[Vector, Number]]:
        return factor_columns(*P)

    def root(self, P: tuple[Rows, Vector], tolerance: Fraction) -> tuple[list[Vector], list[Value]]:
        return columns_of(root_of_factors(*P)), []

    def downdated(self, t: Trace, P: tuple[Rows, Vector], c: Vector, s: Number, tolerance: Fraction, sure: bool,
                  prior: Covariance) -> tuple[tuple[Rows, Vector], Value]:  # fmt: skip
        U, D = [list(row) for row in P[0]], list(P[1])
        smallest = None
        if not sure:
            dense = self.entries(P)
            smallest = [dense[j, j] * tolerance for j in range(self.n)]
        failed, gone = linalg.downdate(U, D, c, s, 1024 * tolerance, smallest)  # the points' rounding is in c
        t.flag(gone, "REGULARIZED")
        return (U, D), failed

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        return []

    # covariance in and out, as loops -------------------------------------------------------------------

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j, summed in a loop."""
        n = self.n
        if n == 1:
            return t.element("kf.D", j)
        total = t.variable("sum", t.element("kf.D", j))
        with t.when(i < j):
            total.set(total.get() * t.element("kf.U", triangle(j) + i))
        with t.loop("k", j + 1, n) as k:
            u = t.element("kf.U", triangle(k) + i) * t.element("kf.D", k)
            total.set(total.get() + u * t.element("kf.U", triangle(k) + j))
        return total.get()

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store the factors (D on the diagonal, U above, upper triangle column by column) of a covariance."""
        with t.loop("j", 0, self.n) as j:
            if self.n > 1:
                with t.loop("i", 0, j) as i:
                    t.store("kf.U", triangle(j) + i, factors[column(j) + i])
            t.store("kf.D", j, factors[column(j) + j])


def triangle(j: Value) -> Value:
    """j (j - 1) / 2: where column j of a strictly upper triangle starts."""
    t = j.trace
    return t.wrapped(t.pool.make("half", ((j * (j - 1)).node,), kind="int"))


def column(j: Value) -> Value:
    """j (j + 1) / 2: where column j of an upper triangle starts."""
    t = j.trace
    return t.wrapped(t.pool.make("half", ((j * (j + 1)).node,), kind="int"))
