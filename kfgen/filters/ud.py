"""Covariance kept as P = U D U^T: U unit upper triangular, D diagonal (Bierman 1977; Thornton 1976)."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters import linalg
from kfgen.filters.base import Block
from kfgen.filters.linalg import Rows, Vector
from kfgen.filters.numbers import assume_nonnegative, is_one, is_zero, require_nonnegative, select
from kfgen.ir.trace import Array, Trace, Value


def packed(i: int, j: int) -> int:
    """Position of U_ij, i < j, in the packed array: strictly upper, column by column."""
    return j * (j - 1) // 2 + i


class UD:
    """Layout `ud`, with the updates `bierman` and `joseph`."""

    title = "U D U^T"
    reorders = True

    def __init__(self, n: int, update: str) -> None:
        self.n = n
        self.form = update
        # Elements of U are fetched once for a group of columns; the columns have to stay in registers.
        self.group = max(2, 40 // n)

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        n = self.n
        U, D = linalg.udu([list(row) for row in P0])
        flat = tuple(Fraction(U[i][j]) for j in range(n) for i in range(j))
        out = []
        if n > 1:
            out.append(Block("U", n * (n - 1) // 2, "unit upper triangular factor, strict upper triangle by columns",
                             initial=flat))  # fmt: skip
        out.append(Block("D", n, "diagonal factor: P = U D U^T", initial=tuple(Fraction(d) for d in D)))
        return out

    def load(self, t: Trace) -> tuple[Rows, Vector]:
        n = self.n
        U: Rows = [[t.element("kf.U", packed(i, j)) if i < j else t.zero for j in range(n)] for i in range(n)]
        D = [assume_nonnegative(t.element("kf.D", j)) for j in range(n)]
        return U, D

    def predict(self, t: Trace, P: tuple[Rows, Vector], F: Rows, Q: Rows, noise: list[tuple[Vector, Value]]
                ) -> tuple[Rows, Vector]:  # fmt: skip
        """P <- F P F^T + Q + sum of d w w^T over the noise columns (w, d)."""
        U, D = P
        n = self.n
        UQ, DQ = self._factored_noise(t, Q)
        for _, d in noise:
            require_nonnegative(d, "a noise variance is negative")
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

    def _factored_noise(self, t: Trace, Q: Rows) -> tuple[Rows, Vector]:
        n = self.n
        if all(is_zero(Q[i][j]) for i in range(n) for j in range(i + 1, n)):
            U: Rows = [[t.zero] * n for _ in range(n)]
            D = [Q[i][i] for i in range(n)]
        else:
            U, D = linalg.udu(Q)
        for d in D:
            require_nonnegative(d, "a noise variance is negative")
        return U, D

    def update(self, t: Trace, P: tuple[Rows, Vector], rows: Rows, variances: Vector
               ) -> tuple[tuple[Rows, Vector], Rows, Vector]:  # fmt: skip
        """Scalar measurements one after another: P, the gains (m, n) and the innovation variances (m,)."""
        U, D = P
        if self.form == "joseph":
            gains, s = [], []
            for h, r in zip(rows, variances, strict=True):
                K, variance = self._joseph(U, D, h, r)
                gains.append(K)
                s.append(variance)
            return P, gains, s
        gains, s = linalg.bierman(U, D, rows, variances)
        return P, gains, s

    def _joseph(self, U: Rows, D: Vector, h: Vector, r: Value) -> tuple[Vector, Value]:
        """(I - K h) P (I - K h)^T + r K K^T by weighted Gram-Schmidt of [(K h - I) U | K], weights [D, r]."""
        n = self.n
        f = [linalg.dot([U[i][j] for i in range(j)] + [1], h[: j + 1]) for j in range(n)]
        v = [fj if is_zero(fj) else d * fj for d, fj in zip(D, f, strict=True)]
        s = r + linalg.dot(f, v)
        c = [linalg.dot([1] + [U[i][j] for j in range(i + 1, n)], v[i:]) for i in range(n)]
        K = linalg.quotients(c, s, r)
        rows = [
            [K[i] * f[j] - (U[i][j] if j > i else 1 if j == i else 0) if not is_zero(K[i]) and not is_zero(f[j])
             else -(U[i][j]) if j > i else -1 if j == i else 0 for j in range(n)] + [K[i]]
            for i in range(n)
        ]  # fmt: skip
        U1, D1 = linalg.gram_schmidt(rows, [*D, r])
        for i in range(n):
            D[i] = D1[i]
            U[i][:] = U1[i]
        return K, s

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
                t.store("kf.U", packed(i, j), t.name(U[i][j], f"u_{names[i]}_{names[j]}"))
        for j in range(self.n):
            t.store("kf.D", j, t.name(D[j], f"d_{names[j]}"))

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
