"""The update of a sigma-point filter: what the points predict of a measurement, and what the state learns of it.

The whole vector at once: S = L D L^T in the order of the components; with the columns c_k of Pxz L^-T and the
entries nu_k of L^-1 y, x += sum c_k nu_k / d_k and P -= sum c_k c_k^T / d_k. Sequential: H = Pxz^T P^-1, and then
component by component as in an ekf.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.linalg import Rows, Vector, times
from kfgen.filters.algebra.numbers import (
    assume_nonnegative,
    assume_positive,
    is_positive,
    is_zero,
    reciprocal,
    require_nonnegative,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.motion import Moved
from kfgen.filters.covariance.parts import Removal
from kfgen.filters.frame import guards
from kfgen.filters.kinds.ekf import Ekf
from kfgen.filters.kinds.work import Update
from kfgen.filters.sigma.innovation import Factored, Trust, factored, known_squares, pivots
from kfgen.filters.sigma.seeing import Seeing
from kfgen.filters.sigma.turned import Seen
from kfgen.filters.steps.gate import chi2_threshold
from kfgen.filters.steps.phases import Judged, Made, Phases
from kfgen.filters.steps.sensor import Linearised, SensorCode, decorrelated, masked
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model.model import SensorModel
from kfgen.quantiles import log_two_pi


def whole_vector(ukf: Ekf, seeing: Seeing, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
    """The update of a sensor by the whole vector."""
    model, form = ukf.model, ukf.form
    t.section("innovation")
    code = SensorCode(t, model, sensor, ukf.order, skipped=seeing.carried)
    code.counts = used
    u = Update(t, sensor, code, code.prior(), form, used, ukf.adapted_R(sensor))
    failures: list[Value] = []
    array = out = None
    if seeing.linear:
        seen = seeing.analytic(u)
    else:
        out, array, failures = seeing.look(u)
        seen = seeing.read(t, out)
    linear = code.linearise(u.x)
    work = _Whole(ukf, u, seeing, linear, seen)
    t.section("its covariance S = L D L^T")
    first = work.factored(seen, made=model.options.inflation is None)
    nis = t.name(first.nis, "nis")
    t.section("guards")
    sound = [*work.y(seen), *first.pivots, *u.tested, *(v for row in work.R for v in row)]
    guards.finite(t, [*sound, nis] if sensor.gate is None else sound)
    guards.doubts(t, [v for row in work.R for v in row])
    guards.positive(t, [*failures, *first.failures])
    yield Judged(nis)
    P = u.P
    final = first
    if model.options.inflation is not None:
        P, final = work.inflated(seen, first, array, out)
    t.section("gain and covariance")
    prior = P
    failed: list[Value] = [] if final is first else list(final.failures)
    how = Removal(seeing.tolerance, work.sure, work.definite)
    motion = Moved(t, ukf.order, [0] * seeing.n)
    likelihood: Value = t.zero
    for j in range(seeing.m):
        c = [final.columns[j][place] for place in ukf.order]
        P, bad = form.downdated(t, P, c, final.D[j], how, prior)
        if not work.definite:  # else it can only be round-off, and has been taken for zero
            failed.append(bad)
        step = final.nu[j] * final.inverse[j]
        motion = motion.by(c, step)
        term = final.nu[j] * step + t.function("log", final.D[j]) + t.value(log_two_pi())
        counts = final.some[j]
        if used is not None:
            counts = used[j] if counts is None else counts & used[j]
        likelihood = likelihood + (term if counts is None else t.select(counts, term, 0))
    doubtful: Value | None = None
    if work.definite:
        P, doubtful = form.bounded(t, P, prior, final.share, seeing.tolerance)
    t.section("state")
    x = ukf.moved(u, motion)
    if u.turns:
        P = ukf.reset(u, P)
    evidence = ukf.unconfined(x) + form.evidence(P, after_predict=final is not first)
    P = ukf.limited(t, P)
    x = ukf.state.confined(t, x)
    t.section("guards")
    guards.finite(t, [nis, *x, *evidence], [] if final is first else [*final.D, likelihood])
    if not work.definite:
        P, indefinite = form.indefinite(P, seeing.n * ukf.scalar.epsilon)
        failed += indefinite
    guards.positive(t, failed)
    log_likelihood = likelihood * Fraction(-1, 2)
    learnt = ukf.prepared(u, x, P, motion)
    yield Made(x, P, nis, log_likelihood)
    ukf.store_update(u, x, P, learnt)
    if doubtful is not None and doubtful.constant != 0:
        with t.when(doubtful):
            form.limit_correlations(t)


class _Whole:
    """The pieces of a whole-vector update that are made twice where P is inflated."""

    def __init__(self, ukf: Ekf, u: Update, seeing: Seeing, linear: Linearised, seen: Seen) -> None:
        self.ukf = ukf
        self.u = u
        self.seeing = seeing
        self.linear = linear
        m = seeing.m
        R: Rows = linear.R
        if u.adapted is not None:
            adapted = u.adapted.adapted(u.t, seen.spread, u.used)
            R = [[adapted[i, j] for j in range(m)] for i in range(m)]
        R = [[R[i][j] + linear.added[i][j] for j in range(m)] for i in range(m)]
        self.R: Rows = R if u.used is None else masked(u.t, linear, R, u.used)[1]
        if u.adapted is None and any(r.constant is None for row in self.R for r in row):
            for d in decorrelated(u.t, linear, self.R).variances:
                require_nonnegative(d, "R is not positive semidefinite")
                ukf.suppose(u.sensor, d)
        diagonal = all(is_zero(self.R[i][j]) for i in range(m) for j in range(m) if i != j)
        self.definite = seeing.points.positive and seeing.points.exact
        self.exact = any(is_zero(r) for r in pivots(self.R, 8 * m * ukf.scalar.epsilon))  # without noise
        self.sure = diagonal and all(is_positive(self.R[i][i]) for i in range(m)) and self.definite

    def y(self, seen: Seen) -> Vector:
        """z less its prediction; 0 for components that are not used."""
        y = self.u.code.residuals(self.u.x, seen.z)
        if self.u.used is not None:
            y = [select(b, v, self.u.t.zero) for b, v in zip(self.u.used, y, strict=True)]
        return y

    def spread(self, seen: Seen) -> Rows:
        """Pzz; 0 for components that are not used."""
        m, used = self.seeing.m, self.u.used
        if used is None:
            return [[seen.spread[i, j] for j in range(m)] for i in range(m)]
        return [[select(used[i] & used[j], seen.spread[i, j], self.u.t.zero) for j in range(m)] for i in range(m)]

    def factored(self, seen: Seen, made: bool = True) -> Factored:
        """made: whether the update is made of it, so that a floor is flagged."""
        t, used, m = self.u.t, self.u.used, self.seeing.m
        spread, R, cross = self.spread(seen), self.R, seen.cross
        if used is not None:
            cross = [[c if is_zero(c) else select(b, c, t.zero) for b, c in zip(used, row, strict=True)]
                     for row in cross]  # fmt: skip
        S = [[spread[i][j] + R[i][j] for j in range(m)] for i in range(m)]
        floor = self.ukf.model.options.innovation_floor
        if floor is not None:
            for i in range(m):
                low = S[i][i] < floor if used is None else (S[i][i] < floor) & used[i]
                if made:
                    t.flag(low, "REGULARIZED")
                S[i][i] = select(low, t.value(floor), S[i][i])
        names = list(self.seeing.sensor.errors)
        epsilon = self.ukf.scalar.epsilon
        noise = [t.value(0) if self.sure else self._rounding(a, seen) for a in range(m)]
        trust = Trust(self.sure, self.definite, 8 * epsilon, noise)
        return factored(t, names, self.y(seen), S, R, cross, trust)

    def _rounding(self, a: int, seen: Seen) -> Value:
        """What the variance of component a may be by round-off where it is 0."""
        u, points, epsilon = self.u, self.seeing.points, self.ukf.scalar.epsilon
        h = self.linear.H[a]
        if self.seeing.linear:
            dense = u.form.entries(u.P)
            terms = [dense[i, i] * (slope * slope) for i, slope in enumerate(h) if not is_zero(slope)]
            return u.t.value(sum(terms) * (8 * self.seeing.n * epsilon))
        # points differ from each other by the rounding of what h adds up, if by nothing else
        component = self.seeing.sensor.space.numbers_of[a]
        size: Value = u.t.one if component is None else seen.z[component]
        size = size if not self.exact else u.t.function("abs", size)
        if self.exact:
            for place, slope in zip(self.ukf.order, h, strict=True):
                number = u.code.model.space.numbers_of[place]
                if not is_zero(slope):
                    reach = slope if number is None else u.x[number] * slope
                    size = size + u.t.function("abs", reach)
        return size * size * (sum(abs(w) for w in points.wc) * (32 * epsilon) ** 2)

    def inflated(self, seen: Seen, first: Factored, array: Array | None, out: Array | None) -> tuple[Any, Factored]:
        """P <- (1 + a) P where the innovation fails its test, and all that follows from it."""
        t, u, seeing = self.u.t, self.u, self.seeing
        inflation = self.ukf.model.options.inflation
        assert inflation is not None
        t.section("adaptive: is the innovation within its quantile?")
        threshold = inflation.threshold
        limit = chi2_threshold(t, inflation.probability, seeing.m, u.used) if threshold is None else t.value(threshold)
        known = Fraction(1, 10**12) if self.ukf.scalar.name == "double" else Fraction(1, 10**6)
        terms = known_squares(t, self.y(seen), self.spread(seen), first.D, first.some, known)
        fails = t.name(first.nis > limit, "anomaly")
        t.flag(fails, "ANOMALY")
        a = terms * (1 / limit - reciprocal(assume_nonnegative(first.nis))[1])
        factor = assume_positive(t.name(select(fails, 1 + a, t.one), "inflation"))
        P = self.ukf.form.inflated(u.P, factor)
        if array is None or out is None:
            m = seeing.m
            again = Seen(seen.z, Symmetric(m, lambda i, j: seen.spread[i, j] * factor),
                         [[times(c, factor) for c in row] for row in seen.cross], [])  # fmt: skip
            return P, self.factored(again)
        root = t.name(sqrt(factor), "root_inflation")
        with t.when(fails):
            if seeing.kept is not None:
                guards.positive(t, seeing.redraw(u, array))
            with t.loop("k", 0, len(seeing.points.rows)) as k:
                for i in range(seeing.n):
                    array[k * seeing.stride + i] = array[k * seeing.stride + i] * root
            seeing.run(u, out, array)
        return P, self.factored(seeing.read(t, out))
