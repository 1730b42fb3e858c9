"""The upper triangle of P in straight-line code."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.factors import cholesky, factor_columns, indefinite, udu_computed
from kfgen.filters.algebra.limits import Limits
from kfgen.filters.algebra.linalg import Rows, Vector, dot, minus, times
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_nonnegative,
    is_positive,
    is_zero,
    reciprocal,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.symmetric import Symmetric, assembled
from kfgen.filters.algebra.triangles import upper
from kfgen.filters.covariance.full.rounding import (
    UNITS,
    inverse_of,
    is_stored,
    lifting,
    not_negative,
    settled,
    single_state,
    spoilt_by,
)
from kfgen.filters.covariance.full.store import FullStore
from kfgen.filters.covariance.gather import GatheredEntries
from kfgen.filters.covariance.loops.partly import EntriesInLoops
from kfgen.filters.covariance.motion import VectorGain
from kfgen.filters.covariance.names import entry_next
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Columns, GainChange, Gatherer, Gathering, Motion, Removal, Scalar
from kfgen.filters.covariance.straight import StraightLine
from kfgen.ir.trace import Array, Trace, Value


class StraightFull(StraightLine, FullStore):
    """The updates `joseph` and `standard`. Of a covariance only i <= j is used."""

    group = 1

    def __init__(
        self, n: int, update: str, epsilon: Fraction, sequence: list[int], change: GainChange | None = None,
        coarse: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(n)
        self.form = update
        self.change = change
        self.epsilon = epsilon
        self.coarse = coarse  # fixed point: every entry has a format of its own, and none of them can be looped over
        # After a prediction the columns are computed and stored in an order that keeps together what the model
        # couples: few entries of the old P are then still needed when they are overwritten.
        self.sequence = sequence

    def plain(self) -> StraightFull:
        if self.change is None:
            return self
        return StraightFull(self.n, self.form, self.epsilon, self.sequence, None, self.coarse)

    def load(self, t: Trace) -> Symmetric:
        return Symmetric(self.n, lambda i, j: t.element("kf.P", upper(i, j)))

    def predict(self, t: Trace, P: Symmetric, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Symmetric:
        """F P F^T + Q + sum of d w w^T over the noise columns (w, d)."""
        additive = Q.entries()
        t.section("P = F P F^T + Q: the diagonal first, for the guards")

        def with_noise(i: int, j: int, p: Value) -> Value:
            if not is_zero(additive[i][j]):
                p = p + additive[i][j]
            for w, d in noise:
                if not is_zero(w[i]) and not is_zero(w[j]):
                    p = p + w[i] * d * w[j]
            return p

        for j in range(self.n):
            assume_nonnegative(P[j, j])
        return P.congruent(F).changed(with_noise)

    def update(
        self, t: Trace, P: Symmetric, measurements: list[Scalar], motion: Motion
    ) -> tuple[Symmetric, list[VectorGain]]:
        gains = []
        for scalar in measurements:
            measurement = scalar.measurement
            h, r = measurement.h, measurement.r
            c = P.times(h)
            spread, direct = dot(h, c), self._is_direct(P, h)
            bounded = not direct and (self.coarse or not is_positive(r))
            variance = times(measurement.g, not_negative(spread) if bounded else spread) + r
            spoilt = None
            if not bounded and not direct:
                spoilt = spoilt_by(variance, r) if single_state(h) < 0 else spread < 0
            if single_state(h) >= 0:  # by a guard
                assume_nonnegative(P[single_state(h), single_state(h)])
            K, inverse = self._gain(c, variance, r)
            if self.change is not None:
                K = self.change(K)
            if self.form == "joseph":
                lift = 0 if self.coarse else times(lifting(variance, r), UNITS * self.epsilon)
                P = P.joseph(measurement, c, K, self.change is not None, lift)
            else:
                P = P.downdated(measurement, c, K)
            if not is_positive(r):
                P = self._clamped(t, P, measurement, K, c)
            gains.append(VectorGain(K, variance, scalar.innovation, inverse, not direct, spoilt))
        return P, gains

    def _is_direct(self, P: Symmetric, h: Vector) -> bool:
        """Whether a row measures a variance of the struct: only who has written it there can have made it negative."""
        state = single_state(h)
        return state >= 0 and is_stored(P[state, state])

    def _gain(self, c: Vector, s: Value, r: Number) -> tuple[Vector, Number | None]:
        """c / s, and 1 / s where it is not the plain one."""
        if self.coarse or self.form == "joseph":
            inverse = 1 / s if is_positive(r) else reciprocal(s)[1]
            return [times(x, inverse) for x in c], None
        plain, inverse = inverse_of(s, r, self.epsilon)
        return [times(x, inverse) for x in c], plain

    def entries(self, P: Symmetric) -> Symmetric:
        return P

    def variance(self, P: Symmetric, h: Vector) -> Number:
        spread = dot(h, P.times(h))
        return spread if self._is_direct(P, h) else not_negative(spread)

    def inflated(self, P: Symmetric, a: Number) -> Symmetric:
        return P.changed(lambda i, j, p: p * a)

    def _clamped(self, t: Trace, P: Symmetric, measurement: Measurement, K: Vector, c: Vector) -> Symmetric:
        """A variance that an exact measurement took to zero may come out below it by round-off: back to zero."""
        low = {}
        for i in range(self.n):
            if not is_zero(K[i]):
                old = P[i, i] + times(measurement.g, K[i]) * c[i]
                low[i] = (P[i, i] < 0) & (P[i, i] >= -(old * (4 * self.n * self.epsilon)))
                t.flag(low[i], "REGULARIZED")
        return P.changed(lambda i, j, p: select(low[i], 0, p) if i == j and i in low else p)

    def tolerance(self, P: Symmetric, h: Vector) -> Value | int:
        return round_off(P, h, self.epsilon)

    def limit(
        self, t: Trace, P: Symmetric, floors: Limits, ceilings: Limits, epsilon: Fraction
    ) -> Symmetric:
        """variance_floor raises P_ii; variance_ceiling scales row and column i down."""
        low, high, scale = {}, {}, {}
        for i, floor in enumerate(floors):
            if floor is not None:
                low[i] = P[i, i] < floor
                t.flag(low[i], "REGULARIZED")
        P = P.changed(lambda i, j, p: select(low[i], floors[i], p) if i == j and i in low else p)
        for i, ceiling in enumerate(ceilings):
            if ceiling is not None:
                high[i] = P[i, i] > ceiling
                t.flag(high[i], "REGULARIZED")
                scale[i] = select(high[i], sqrt(ceiling / P[i, i]), 1)

        def bounded(i: int, j: int, p: Value) -> Value:
            if i == j:
                return select(high[i], ceilings[i], p) if i in high else p
            for k in (i, j):
                p = p * scale[k] if k in scale else p
            return p

        return P.changed(bounded)

    def evidence(self, P: Symmetric, after_predict: bool) -> list[Value]:
        """The diagonal: |P_ij| <= max(P_ii, P_jj), and its products bound those off the diagonal.

        A standard update needs none beside x: c_i^2 / s <= P_ii (Cauchy and Schwarz) is finite where P was.
        """
        if not (after_predict or self.form == "joseph"):
            return []
        return [P[i, i] for i in range(self.n) if self.coarse or not settled(P[i, i])]

    def store(self, t: Trace, P: Symmetric, names: list[str], after_predict: bool) -> None:
        signs: Value | None = None
        for last, j in enumerate(self.sequence if after_predict else range(self.n)):
            for i in self.sequence[: last + 1] if after_predict else range(j + 1):
                low, high = min(i, j), max(i, j)
                p = t.value(P[low, high])
                if i == j and t.stores and not is_nonnegative(p):
                    if self.coarse:
                        t.flag(p < 0, "REGULARIZED")
                        p = select(p < 0, -p, p)
                    else:
                        signs = t.sign(p, signs)
                if not (t.in_place and is_stored(p) and t.element("kf.P", upper(low, high)).node is p.node):
                    t.store("kf.P", upper(low, high), t.name(p, entry_next("p", names, low, high)))
        if signs is not None:
            met = t.wrapped(t.pool.some(signs.node))
            t.later(lambda: self._settle_if(t, met))

    def _settle_if(self, t: Trace, met: Value) -> None:
        with t.when(met, rare=True):
            self.settle(t)

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> Symmetric:
        return assembled(U, D)

    def from_entries(self, P: Symmetric) -> Symmetric:
        return P

    def factors(self, P: Symmetric) -> tuple[Rows, Vector]:
        dense = [[P[min(i, j), max(i, j)] for j in range(self.n)] for i in range(self.n)]
        return udu_computed(dense, self.n * self.epsilon)

    def columns(self, P: Symmetric) -> list[tuple[Vector, Number]]:
        return factor_columns(*self.factors(P))

    def root(self, t: Trace, P: Symmetric, tolerance: Fraction, stored: bool, in_loops: bool) -> Array | Columns:
        if stored and in_loops:
            return self.root_array(t, tolerance)
        S, failures = cholesky(lambda i, j: P[i, j], self.n, tolerance)
        return Columns([[S[i][j] for i in range(self.n)] for j in range(self.n)], failures)

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> Gatherer[Symmetric]:
        return EntriesInLoops(t, Q, noise, how) if how.in_loops else GatheredEntries(t, Q, noise, how)

    def downdated(
        self, t: Trace, P: Symmetric, c: Vector, s: Number, how: Removal, prior: Symmetric
    ) -> tuple[Symmetric, Value]:
        inverse = 1 / s
        K = [times(x, inverse) for x in c]
        after = P.changed(lambda i, j, p: minus(p, times(K[i], c[j])))
        failed: Value = t.wrapped(t.pool.boolean(False))
        if how.definite:
            return after, failed
        low = {i: after[i, i] < 0 for i in range(self.n) if not is_zero(c[i])}
        for i, negative in low.items():
            failed = failed | (after[i, i] < -(P[i, i] * (1024 * how.tolerance)))  # the points' rounding is in c
            t.flag(negative, "REGULARIZED")
        return after.changed(lambda i, j, p: select(low[i], 0, p) if i == j and i in low else p), failed

    def bounded(
        self, t: Trace, P: Symmetric, prior: Symmetric, share: Value, tolerance: Fraction
    ) -> tuple[Symmetric, Value]:
        doubtful = t.name(share < tolerance, "doubtful")
        changed = [i for i in range(self.n) if not _same(P[i, i], prior[i, i])]
        variances = {i: t.variable(t.unique(f"variance_{i}"), P[i, i]) for i in changed}
        with t.when(doubtful):
            for i, variance in variances.items():
                value, least = variance.get(), prior[i, i] * share
                t.flag(value < 0, "REGULARIZED")
                # without noise what is left is nothing but rounding
                low = value < select(share > 0, least, prior[i, i] * tolerance)
                variance.set(select(low, least, value))
        found = {i: variance.get() for i, variance in variances.items()}
        return P.changed(lambda i, j, p: found[i] if i == j and i in found else p), doubtful

    def indefinite(self, P: Symmetric, tolerance: Fraction) -> tuple[Symmetric, list[Value]]:
        return P, indefinite(P, tolerance)


def _same(a: Number, b: Number) -> bool:
    return isinstance(a, Value) and isinstance(b, Value) and a.node is b.node


def round_off(P: Symmetric, h: Vector, epsilon: Fraction) -> Value | int:
    """How far below zero h P h^T may come out by round-off."""
    terms = [(hi * hi * P[i, i]) for i, hi in enumerate(h) if not is_zero(hi)]
    return sum(terms[1:], terms[0]) * (4 * P.n * epsilon) if terms else 0
