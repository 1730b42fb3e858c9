"""The lower Cholesky factor in straight-line code (Carlson 1973; Kaminski, Bryson & Schmidt 1971)."""

from __future__ import annotations

from fractions import Fraction
from functools import reduce
from operator import or_

from kfgen.filters.algebra.factors import columns_of, root_of_factors, udu
from kfgen.filters.algebra.limits import Limits, margin, raised
from kfgen.filters.algebra.linalg import Rows, Vector, dot, minus, plus, quotients, times, zeros
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    assume_positive,
    is_positive,
    is_zero,
    reciprocal,
    require_nonnegative,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.gather import GatheredFactors
from kfgen.filters.covariance.loops.partly import FactorsInLoops
from kfgen.filters.covariance.motion import VectorGain
from kfgen.filters.covariance.names import entry_next
from kfgen.filters.covariance.noise import NEGATIVE, Additive
from kfgen.filters.covariance.parts import Columns, Gatherer, Gathering, Motion, Removal, Scalar
from kfgen.filters.covariance.sqrt.store import SqrtStore
from kfgen.filters.covariance.straight import StraightLine
from kfgen.ir.trace import Array, Trace, Value


class StraightSqrt(StraightLine, SqrtStore):
    """A covariance is the rows of S, upper triangular in the inner order."""

    group = 1

    def plain(self) -> StraightSqrt:
        return self

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
        rank_one(U, D, [(w, d, -1) for w, d in noise], safe=True)
        t.section("F S S^T F^T + Q")
        for k in range(n):
            column_k: Vector = [dot(F[i][: k + 1], [P[j][k] for j in range(k + 1)]) for i in range(n)]
            rank_one(U, D, [(column_k, t.one, k)], safe=True)
        return self.from_factors(t, U, D)

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> Rows:
        t.section("roots")
        return root_of_factors(U, D)

    def from_entries(self, P: Symmetric) -> Rows:
        return root_of_factors(*udu([[P[i, j] for j in range(self.n)] for i in range(self.n)]))

    def factors(self, P: Rows) -> tuple[Rows, Vector]:
        n = self.n
        U, D = zeros(n, n), [times(P[j][j], P[j][j]) for j in range(n)]
        for j in range(1, n):
            inverse = reciprocal(assume_nonnegative(P[j][j]))[1]
            for i in range(j):
                U[i][j] = times(P[i][j], inverse)
        return U, [assume_nonnegative(d) for d in D]

    def columns(self, P: Rows) -> list[tuple[Vector, Number]]:
        return [(column, 1) for column in columns_of(P)]

    def root(self, t: Trace, P: Rows, tolerance: Fraction, stored: bool, in_loops: bool) -> Array | Columns:
        if stored and in_loops:
            return self.root_array(t)
        # in the order of the spec's lower factor: its first column is the inner order's last
        return Columns(columns_of(P)[::-1], [])

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> Gatherer[Rows]:
        def finish(U: Rows, D: Vector) -> Rows:
            return self.from_factors(t, U, D)

        if how.in_loops:
            return FactorsInLoops(t, self.order, Q, noise, how, finish)
        return GatheredFactors(t, Q, noise, how, finish)

    def indefinite(self, P: Rows, tolerance: Fraction) -> tuple[Rows, list[Value]]:
        """Never: it is a square."""
        return P, []

    def downdated(
        self, t: Trace, P: Rows, c: Vector, s: Number, how: Removal, prior: Rows
    ) -> tuple[Rows, Value]:
        """S S^T - w w^T, w = c / sqrt(s), by the downdate of van der Merwe & Wan 2001 (Golub & Van Loan 6.5.4).

        r^2 = S_jj^2 - w_j^2, S_ij <- (S_ij - w_j w_i / S_jj) S_jj / r, w_i <- (r w_i - w_j S_ij) / S_jj with the new
        S_ij. r^2 up to `tolerance` of S_jj^2 is 0, and a w_j up to it of the variance is no w_j.
        """
        n = self.n
        S = [list(row) for row in P]
        scale = 1 / sqrt(s)
        w = [times(x, scale) for x in c]
        failed: Value = t.wrapped(t.pool.boolean(False))
        left: Value = t.wrapped(t.pool.boolean(True))  # whether there is still something to take away
        for j in reversed(range(n)):
            if is_zero(w[j]):
                continue
            small = how.tolerance * how.tolerance * dot(prior[j][j:], prior[j][j:])
            acts = left & (w[j] * w[j] > small)
            square = S[j][j] * S[j][j] - w[j] * w[j]
            limit = S[j][j] * S[j][j] * how.tolerance
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
                new = times(minus(S[i][j], times(sine, w[i])), quotient)
                w[i] = minus(times(cosine, w[i]), times(sine, new))
                S[i][j] = select(gone, 0, new)
        return S, failed

    def update(
        self, t: Trace, P: Rows, measurements: list[Scalar], motion: Motion
    ) -> tuple[Rows, list[VectorGain]]:
        S = [list(row) for row in P]
        gains = []
        for scalar in measurements:
            K, s = self._carlson(S, scalar.measurement)
            gains.append(VectorGain(K, s, scalar.innovation))
        return S, gains

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
            f = dot([S[i][j] for i in range(j + 1)], h[: j + 1])
            if is_zero(f):
                continue
            weighted = times(g, f)
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
                S[i][j] = minus(times(beta, old), times(gamma, b[i]))
                b[i] = plus(b[i], times(f, old))
            b[j] = times(f, S[j][j])
            S[j][j] = assume_nonnegative(times(beta, S[j][j]))
            before = after
        return quotients(b, a, measurement.r), a

    def entries(self, P: Rows) -> Symmetric:
        return Symmetric(self.n, lambda i, j: dot(P[i][j:], P[j][j:]))

    def variance(self, P: Rows, h: Vector) -> Number:
        f = [dot([P[i][j] for i in range(j + 1)], h[: j + 1]) for j in range(self.n)]
        return dot(f, f)

    def inflated(self, P: Rows, a: Number) -> Rows:
        root = sqrt(a)
        return [[times(x, root) for x in row] for row in P]

    def tolerance(self, P: Rows, h: Vector) -> Value | int:
        """None: a sum of squares is not negative."""
        return 0

    def limit(self, t: Trace, P: Rows, floors: Limits, ceilings: Limits, epsilon: Fraction) -> Rows:
        """A floor by way of U D U^T, where one is met; a ceiling scales row i down."""
        n, S = self.n, [list(row) for row in P]
        if any(floor is not None for floor in floors):
            U, D = self.factors(S)
            below = list(raised(U, D, floors, epsilon).values())
            for condition in below:
                t.flag(condition, "REGULARIZED")
            met, new = t.name(reduce(or_, below), "below"), root_of_factors(U, D)
            S = [[select(met, new[i][j], S[i][j]) if i <= j else S[i][j] for j in range(n)] for i in range(n)]
            for i in range(n):
                assume_nonnegative(S[i][i])
        for i, ceiling in enumerate(ceilings):
            if ceiling is not None:
                p = dot(S[i][i:], S[i][i:])
                above = p > ceiling * (1 + margin(n, epsilon))
                t.flag(above, "REGULARIZED")
                scale = assume_nonnegative(select(above, sqrt(ceiling / p), 1))
                S[i] = [times(x, scale) for x in S[i]]
                assume_nonnegative(S[i][i])
        return S

    def evidence(self, P: Rows, after_predict: bool) -> list[Value]:
        """After an update none beside x: a gain that has met a value that is not finite stays so."""
        return [P[j][j] for j in range(self.n)] if after_predict else []

    def store(self, t: Trace, P: Rows, names: list[str], after_predict: bool) -> None:
        for i in reversed(range(self.n)):
            for j in reversed(range(i, self.n)):
                t.store("kf.S", self.packed(i, j), t.name(t.value(P[i][j]), entry_next("s", names, i, j)))


def _root(a: Number) -> tuple[Number, Number]:
    """sqrt(a) and its reciprocal; 0 and 0 where a is 0."""
    root = sqrt(a)
    if is_positive(a):
        assume_positive(root)
        inverse = 1 / root
        return root, inverse
    return root, reciprocal(assume_nonnegative(root))[1]
