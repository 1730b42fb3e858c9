"""Covariance kept as its lower Cholesky factor, P = S S^T (Carlson 1973; Kaminski, Bryson & Schmidt 1971).

Inside, the states are in reverse order: S is then upper triangular, and the kernels of U D U^T serve it too.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Measurement, Rows, Vector
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    assume_positive,
    constant_root,
    is_positive,
    is_zero,
    reciprocal,
    require_nonnegative,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import CONST_KF, KF, Block
from kfgen.filters.covariance.base import Covariance, GainChange
from kfgen.filters.covariance.gather import columns_of, root_of_factors
from kfgen.filters.covariance.names import entry_next
from kfgen.filters.covariance.noise import NEGATIVE, Additive
from kfgen.filters.covariance.ud.straight import column
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value


class Sqrt:
    """Layout `sqrt`. A covariance is the rows of S, upper triangular in the inner order."""

    title = "lower triangular square root"
    reorders = False
    rolled = False
    tables: Mapping[str, tuple[int, ...]] = {}
    change: GainChange | None = None
    factored = True
    group = 1

    def __init__(self, n: int) -> None:
        self.n = n
        self.order = list(reversed(range(n)))

    def packed(self, i: int, j: int) -> int:
        """Position of S_ij, i <= j: lower triangle row by row in the order of the spec."""
        row, place = self.n - 1 - i, self.n - 1 - j
        return row * (row + 1) // 2 + place

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        n = self.n
        U, D = linalg.udu([list(row) for row in P0])
        roots = [Fraction(0) if d == 0 else constant_root(d) for d in D]
        values = [Fraction(0)] * (n * (n + 1) // 2)
        for j in range(n):
            for i in range(j + 1):
                values[self.packed(i, j)] = roots[j] * (1 if i == j else Fraction(U[i][j]))
        doc = "lower triangular root, P = S S^T: S_ij, i >= j, at i (i + 1) / 2 + j"
        return [Block("S", len(values), doc, initial=tuple(values))]

    def load(self, t: Trace) -> Rows:
        n = self.n
        S: Rows = [[t.zero] * n for _ in range(n)]
        for i in range(n):
            for j in range(i, n):
                S[i][j] = t.element("kf.S", self.packed(i, j))
            assume_nonnegative(S[i][i])
        return S

    def predict(self, t: Trace, P: Rows, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Rows:
        """S S^T <- F S S^T F^T + Q + sum of d w w^T: rank-one updates of L D L^T, one root per state at the end."""
        n = self.n
        U, D = Q.factors()
        for _, d in noise:
            require_nonnegative(d, NEGATIVE)
        t.section("process noise")
        linalg.rank_one(U, D, [(w, d, -1) for w, d in noise], safe=True)
        t.section("F S S^T F^T + Q")
        for k in range(n):
            column_k: Vector = [linalg.dot(F[i][: k + 1], [P[j][k] for j in range(k + 1)]) for i in range(n)]
            linalg.rank_one(U, D, [(column_k, t.one, k)], safe=True)
        return self.from_factors(t, U, D)

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> Rows:
        t.section("roots")
        return root_of_factors(U, D)

    def factors(self, P: Rows) -> tuple[Rows, Vector]:
        n = self.n
        U, D = linalg.zeros(n, n), [linalg.times(P[j][j], P[j][j]) for j in range(n)]
        for j in range(1, n):
            inverse = reciprocal(assume_nonnegative(P[j][j]))[1]
            for i in range(j):
                U[i][j] = linalg.times(P[i][j], inverse)
        return U, [assume_nonnegative(d) for d in D]

    def columns(self, P: Rows) -> list[tuple[Vector, Number]]:
        return [(column, 1) for column in columns_of(P)]

    def root(self, P: Rows, tolerance: Fraction) -> tuple[list[Vector], list[Value]]:
        # in the order of the spec's lower factor: its first column is the inner order's last
        return columns_of(P)[::-1], []

    def downdated(self, t: Trace, P: Rows, c: Vector, s: Number, tolerance: Fraction, sure: bool, prior: Covariance
    ) -> tuple[Rows, Value]:
        """S S^T - w w^T, w = c / sqrt(s), by the downdate of van der Merwe & Wan 2001 (Golub & Van Loan 6.5.4).

        r^2 = S_jj^2 - w_j^2, S_ij <- (S_ij - w_j w_i / S_jj) S_jj / r, w_i <- (r w_i - w_j S_ij) / S_jj with the new
        S_ij. r^2 up to `tolerance` of S_jj^2 is 0, and a w_j up to it of the variance is no w_j.
        """
        n = self.n
        S = [list(row) for row in P]
        scale = 1 / sqrt(s)
        w = [linalg.times(x, scale) for x in c]
        failed: Value = t.wrapped(t.pool.boolean(False))
        left: Value = t.wrapped(t.pool.boolean(True))  # whether there is still something to take away
        for j in reversed(range(n)):
            if is_zero(w[j]):
                continue
            small = tolerance * tolerance * linalg.dot(prior[j][j:], prior[j][j:])
            acts = left & (w[j] * w[j] > small)
            square = S[j][j] * S[j][j] - w[j] * w[j]
            limit = S[j][j] * S[j][j] * tolerance
            failed = failed | (acts & (square < -limit))
            gone = acts & (square <= limit)
            t.flag(gone, "REGULARIZED")
            left = left & ~gone
            acts = acts & ~gone
            r = sqrt(select(acts, square, 1))
            inverse = select(acts, 1 / S[j][j], 0)
            # where nothing is taken away: c = 1, s = 0
            cosine = select(acts, r * inverse, 1)
            sine = w[j] * inverse
            quotient = select(acts, S[j][j] * (1 / r), 1)
            S[j][j] = select(gone, 0, select(acts, r, S[j][j]))
            for i in range(j):
                new = linalg.times(linalg.minus(S[i][j], linalg.times(sine, w[i])), quotient)
                w[i] = linalg.minus(linalg.times(cosine, w[i]), linalg.times(sine, new))
                S[i][j] = select(gone, 0, new)
        return S, failed

    def update(self, t: Trace, P: Rows, measurements: list[Measurement]) -> tuple[Rows, Rows, Vector]:
        """Scalar measurements one after another: S, the gains (m, n) and the innovation variances (m,)."""
        S = [list(row) for row in P]
        gains, s = [], []
        for measurement in measurements:
            K, variance = self._carlson(S, measurement)
            gains.append(K)
            s.append(variance)
        return S, gains, s

    def _carlson(self, S: Rows, measurement: Measurement) -> tuple[Vector, Number]:
        """Carlson's update in place (1973, eq. 16 to 20), with the weight g.

        f = S^T h^T; a_j = a_j-1 + g f_j^2 from a = r on; S_ij <- sqrt(a_j-1 / a_j) S_ij - g f_j b_i / sqrt(a_j-1 a_j),
        b_i <- b_i + f_j S_ij: b ends as P h^T, a as s.
        """
        n, g, h = self.n, measurement.g, measurement.h
        b: Vector = [0] * n
        a = measurement.r
        before: tuple[Number, Number] | None = None  # sqrt(a), 1 / sqrt(a)
        for j in range(n):
            f = linalg.dot([S[i][j] for i in range(j + 1)], h[: j + 1])
            if is_zero(f):
                continue
            weighted = linalg.times(g, f)
            before = _root(a) if before is None else before
            sure = is_positive(a)
            a = a + weighted * f
            if sure:
                assume_positive(a)
            after = _root(a)
            beta = before[0] * after[1]
            if not sure:
                beta = select(a > 0, beta, 1)
            gamma = weighted * after[1] * before[1]
            for i in range(j):
                old = S[i][j]
                S[i][j] = linalg.minus(linalg.times(beta, old), linalg.times(gamma, b[i]))
                b[i] = linalg.plus(b[i], linalg.times(f, old))
            b[j] = linalg.times(f, S[j][j])
            S[j][j] = assume_nonnegative(linalg.times(beta, S[j][j]))
            before = after
        return linalg.quotients(b, a, measurement.r), a

    def entries(self, P: Rows) -> Symmetric:
        return Symmetric(self.n, lambda i, j: linalg.dot(P[i][j:], P[j][j:]))

    def variance(self, P: Rows, h: Vector) -> Number:
        f = [linalg.dot([P[i][j] for i in range(j + 1)], h[: j + 1]) for j in range(self.n)]
        return linalg.dot(f, f)

    def inflated(self, P: Rows, a: Number) -> Rows:
        root = sqrt(a)
        return [[linalg.times(x, root) for x in row] for row in P]

    def tolerance(self, P: Rows, h: Vector) -> Value | int:
        """None: a sum of squares is not negative."""
        return 0

    def limit(self, t: Trace, P: Rows, floors: list[Fraction | None], ceilings: list[Fraction | None]) -> Rows:
        """variance_floor raises S_ii^2; variance_ceiling scales row i down."""
        for i, (low, high) in enumerate(zip(floors, ceilings, strict=True)):
            if low is not None:
                edge = constant_root(low)
                t.flag(P[i][i] < edge, "REGULARIZED")
                P[i][i] = select(P[i][i] < edge, t.value(edge), P[i][i])
            if high is not None:
                edge = constant_root(high)
                t.flag(P[i][i] > edge, "REGULARIZED")
                scale = select(P[i][i] > edge, edge / P[i][i], 1)
                P[i] = [linalg.times(x, scale) for x in P[i]]
        return P

    def evidence(self, P: Rows, after_predict: bool) -> list[Value]:
        """After an update none beside x: a gain that has met a value that is not finite stays so."""
        return [P[j][j] for j in range(self.n)] if after_predict else []

    def store(self, t: Trace, P: Rows, names: list[str], after_predict: bool) -> None:
        for i in reversed(range(self.n)):
            for j in reversed(range(i, self.n)):
                t.store("kf.S", self.packed(i, j), t.name(t.value(P[i][j]), entry_next("s", names, i, j)))

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        """The root in and out."""
        return [self._set_root(taken, outdated), self._get_root(taken)]

    def _set_root(self, taken: frozenset[str], outdated: str) -> Function:
        t, n = Trace(), self.n
        with t.loop("i", 0, n) as i, t.loop("j", 0, i + 1) as j:
            t.guard(~t.finite(t.element("S", i * n + j)), "NOT_FINITE")
        t.section("columns may change their sign: the diagonal is kept positive")
        with t.loop("i", 0, n) as i, t.loop("j", 0, i + 1) as j:
            value = t.name(t.element("S", i * n + j), "value")
            t.store("kf.S", column(i) + j, select(t.element("S", j * n + j) < 0, -value, value))
        if outdated:
            t.store(outdated, None, t.wrapped(t.pool.boolean(False)))
        doc = "lower triangular root, row-major; the lower triangle is read"
        argument = Argument("S", "{name}_real_t", pointer=True, size=n * n, doc=doc)
        return Function(
            "set_sqrt_covariance", [KF, argument], schedule(t, taken | {"x", "S"}),
            "Replace the covariance by S S^T; the state stays.",
        )  # fmt: skip

    def _get_root(self, taken: frozenset[str]) -> Function:
        t, n = Trace(), self.n
        with t.loop("i", 0, n) as i:
            with t.loop("j", 0, i + 1) as j:
                t.store("S", i * n + j, t.element("kf.S", column(i) + j))
            with t.loop("j", i + 1, n) as j:
                t.store("S", i * n + j, t.zero)
        doc = "lower triangular root, row-major"
        argument = Argument("S", "{name}_real_t", pointer=True, constant=False, size=n * n, doc=doc)
        return Function(
            "get_sqrt_covariance", [CONST_KF, argument], schedule(t, taken | {"x", "S"}),
            "The lower Cholesky factor of the covariance, in the order of the states.", returns="void",
        )  # fmt: skip

    # covariance in and out, as loops -------------------------------------------------------------------

    def _place(self, i: Value, j: Value) -> Value:
        """Position of S_ij for counters i <= j."""
        return column((self.n - 1) - i) + ((self.n - 1) - j)

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j, summed in a loop."""
        total = t.variable("sum", t.zero)
        with t.loop("k", j, self.n) as k:
            total.set(total.get() + t.element("kf.S", self._place(i, k)) * t.element("kf.S", self._place(j, k)))
        return total.get()

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store the root of a covariance given by its factors (D on the diagonal, U above)."""
        with t.loop("j", 0, self.n) as j:
            root = t.name(sqrt(factors[column(j) + j]), "root")
            t.store("kf.S", self._place(j, j), root)
            if self.n > 1:
                with t.loop("i", 0, j) as i:
                    t.store("kf.S", self._place(i, j), factors[column(j) + i] * root)


def _root(a: Number) -> tuple[Number, Number]:
    """sqrt(a) and its reciprocal; 0 and 0 where a is 0."""
    root = sqrt(a)
    if is_positive(a):
        assume_positive(root)
        inverse = 1 / root
        return root, inverse
    return root, reciprocal(assume_nonnegative(root))[1]
