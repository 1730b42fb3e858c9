"""The update of a sigma-point filter: what the points predict of a measurement, and what the state learns of it.

The whole vector at once: S = L D L^T in the order of the components; with the columns c_k of Pxz L^-T and the
entries nu_k of L^-1 y, x += sum c_k nu_k / d_k and P -= sum c_k c_k^T / d_k. Sequential: H = Pxz^T P^-1, and then
component by component as in an ekf.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from kfgen.filters import cloud, guards, linalg
from kfgen.filters.cloud import Private
from kfgen.filters.ekf import Update
from kfgen.filters.gate import chi2_threshold, gate
from kfgen.filters.layout import Covariance
from kfgen.filters.linalg import Rows, Vector, plus, times
from kfgen.filters.numbers import (
    assume_nonnegative,
    assume_positive,
    is_positive,
    is_zero,
    reciprocal,
    require_nonnegative,
    select,
    sqrt,
)  # fmt: skip
from kfgen.filters.points import PointSet
from kfgen.filters.sensor import Linearised, SensorCode, decorrelated
from kfgen.filters.sequence import Updated
from kfgen.filters.symmetric import Symmetric
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import log_two_pi

if TYPE_CHECKING:
    from kfgen.filters.ukf import Ukf


@dataclass(frozen=True)
class Seen:
    """Of m components: z (m,), its covariance without R (m, m), that with the state (n, m) and with the carried
    noises (q, m)."""

    z: Vector
    spread: Symmetric
    cross: Rows
    noise: Rows


class Seeing:
    """What the sigma points of a filter tell of one sensor.

    linear: h needs no points. The private function `see_<sensor>` fills an array with z, the upper triangle of
    the spread, the cross covariances. kept: the same for points that predict has kept, which may be other ones,
    and whose centre need not be x.
    """

    def __init__(self, model: Model, sensor: SensorModel, points: PointSet, carried: tuple[str, ...],
                 tolerance: Fraction, kept: PointSet | None = None, recalls: bool = False) -> None:  # fmt: skip
        self.recalls = recalls  # whether these are the points of predict
        self.kept = None if kept is None else Seeing(model, sensor, kept, (), tolerance, recalls=True)
        self.model = model
        self.sensor = sensor
        self.points = points
        self.carried = carried
        self.tolerance = tolerance
        self.n, self.m, self.q = len(model.states), len(sensor.h), len(carried)
        self.stride = self.n + self.q
        self.symmetric = not recalls and points.balanced
        self.linear = self._is_linear()
        self.h: Private | None = None
        self.see: Private | None = None

    def _is_linear(self) -> bool:
        model, sensor = self.model, self.sensor
        if self.kept is not None or self.recalls or self.carried or not self.points.exact:
            return False
        if any(b is not None for b in model.bounds):
            return False
        if any(p is not None for p in sensor.periods) or any(r is not None for r in sensor.residual):
            return False
        t = Trace()
        code = SensorCode(t, model, sensor, list(range(self.n)))
        linear = code.linearise(code.prior())
        return not cloud.bends([p.value for p in linear.predicted], [v for row in linear.H for v in row])

    @property
    def size(self) -> int:
        """Of the array that `see` fills."""
        return self.m + self.m * (self.m + 1) // 2 + (self.n + self.q) * self.m

    def functions(self, taken: frozenset[str]) -> list[Function]:
        """The private functions of the sensor."""
        if self.linear:
            return []
        self.h = cloud.measurement(self.model, self.sensor, self.carried, taken)
        self.see = self._see(taken)
        out = [self.h.function, self.see.function]
        if self.kept is not None:
            self.kept.h = self.h
            self.kept.see = self.kept._see(taken)
            out.append(self.kept.see.function)
        return out

    @property
    def offset(self) -> int:
        """How many numbers the centre of kept points takes."""
        return self.n if self.points.centre else 0

    def _see(self, taken: frozenset[str]) -> Private:
        model, sensor, points, n, m = self.model, self.sensor, self.points, self.n, self.m
        assert self.h is not None
        t = Trace()
        x = [t.name(t.element("x", i), name) for i, name in enumerate(model.states)]
        point, z = t.array("point", self.stride), t.array("z", m)
        store = None if points.theta == 0 else t.array("dz", len(points.rows) * m)
        used = model.uses(*sensor.h) | cloud.residual_uses(model, sensor)
        arguments, given = cloud.given_for(model, used, False)
        call = self.h.arguments(None)
        middle = [t.element("middle", i) if self.recalls and points.centre else t.zero for i in range(n)]
        for i in range(self.stride):
            point[i] = (x[i] + middle[i] if i < n else t.zero)
        t.call(self.h.function, [*call, ("point", 0), ("z", 0)])
        names = [c.name for c in sensor.spec.components]
        base = [t.name(z[a], f"{name}_centre") for a, name in enumerate(names)]
        shift = [t.variable(f"shift_{name}", 0) for name in names]
        spread = {(a, b): t.variable(f"s_{names[a]}_{names[b]}", 0) for b in range(m) for a in range(b + 1)}
        labels = [*model.states, *self.carried]
        cross = {(i, a): t.variable(f"c_{labels[i]}_{names[a]}", 0) for i in range(self.stride) for a in range(m)}
        first = [t.variable(f"m_{label}", 0) for label in labels] if not self.symmetric else []
        t.section("points through h")
        with t.loop("k", 0, len(points.rows)) as k:
            at = k * self.stride
            for i in range(self.stride):
                own = t.element("cloud", at + i)
                point[i] = x[i] + own if i < n else own
            t.call(self.h.function, [*call, ("point", 0), ("z", 0)])
            d = [t.name(cloud.difference(t, model, sensor, a, z[a], base[a], x), f"dz_{names[a]}") for a in range(m)]
            part = [t.element("cloud", at + i) for i in range(self.stride)]
            wm, wc = cloud.weights(t, points.wm, k, "wm"), cloud.weights(t, points.wc, k, "wc")
            weighted = d if points.uniform else [v * wc for v in d]
            for a in range(m):
                shift[a].set(shift[a].get() + (d[a] if points.uniform else wm * d[a]))
                if store is not None:
                    store[k * m + a] = d[a]
            if store is None:
                for (a, b), variable in spread.items():
                    variable.set(variable.get() + d[a] * weighted[b])
            for (i, a), variable in cross.items():
                variable.set(variable.get() + part[i] * weighted[a])
            for i, variable in enumerate(first):
                variable.set(variable.get() + (part[i] if points.uniform else wc * part[i]))
        scale_m = points.wm[0] if points.uniform else Fraction(1)
        scale_c = points.wc[0] if points.uniform else Fraction(1)
        delta = [t.name(v.get() * scale_m, f"mean_{name}") for v, name in zip(shift, names, strict=True)]
        if store is not None:
            with t.loop("k", 0, len(points.rows)) as k:
                wc = cloud.weights(t, points.wc, k, "wc")
                d = [store[k * m + a] - delta[a] for a in range(m)]
                for (a, b), variable in spread.items():
                    term = d[a] * d[b] if points.uniform else wc * d[a] * d[b]
                    variable.set(variable.get() + term)
        for a in range(m):
            t.store("seen", a, base[a] + delta[a])
        for (a, b), variable in spread.items():
            t.store("seen", m + b * (b + 1) // 2 + a, variable.get() * scale_c + delta[a] * delta[b] * points.extra)
        offset = m + m * (m + 1) // 2
        for (i, a), variable in cross.items():
            value = variable.get() * scale_c
            if first:  # the weighted sum of deviations of x need not be 0
                whole = first[i].get() * scale_c + (middle[i] if i < n else t.zero) * points.wc0
                value = value - whole * delta[a]
            t.store("seen", offset + i * m + a, value)
        sizes = [("x", n, True), *([("middle", n, True)] if self.recalls and points.centre else []),
                 ("cloud", len(points.rows) * self.stride, True), ("seen", self.size, False)]  # fmt: skip
        arrays = [Argument(name, "{name}_real_t", pointer=True, constant=c, size=s) for name, s, c in sizes]
        function = Function(
            f"{'recall' if self.recalls else 'see'}_{sensor.name}", [*arguments, *arrays],
            schedule(t, taken | {"kf", "u", "x", "z", "middle", "cloud", "seen"}),
            f"what the points predict of {sensor.name}: mean, covariance, covariances with the state",
            returns="void", private=True,
        )  # fmt: skip
        return Private(function, given)

    # in the update -----------------------------------------------------------------------------------

    def analytic(self, u: Update) -> Seen:
        """Of a linear h: P H^T and H P H^T."""
        linear = u.code.linearise(u.x)
        dense = u.layout.entries(u.P)
        columns = [dense.times(h) for h in linear.H]
        spread = Symmetric(self.m, lambda a, b: linalg.dot(linear.H[a], columns[b]))
        straight: Rows = [[0] * self.m for _ in range(self.n)]
        for a, column in enumerate(columns):
            for place, value in zip(u.layout.order, column, strict=True):
                straight[place][a] = value
        return Seen([p.value for p in linear.predicted], spread, straight, [])

    def draw(
        self, ukf: Ukf, u: Update, P: Covariance, name: str = "", stored: bool = True
    ) -> tuple[Array, list[Value]]:
        """An array of points of P; conditions of failure. stored: P is that of the struct."""
        array = u.t.array(f"cloud{name}", len(self.points.rows) * self.stride)
        return array, ukf.scatter(u.t, P, self._noise_root(u), self.points, array, stored)

    def redraw(self, ukf: Ukf, u: Update, array: Array) -> list[Value]:
        """Points of the stored P, in a branch of its own; conditions of failure."""
        return ukf.scatter(u.t, u.layout.load(u.t), self._noise_root(u), self.points, array)

    def look(self, ukf: Ukf, u: Update) -> tuple[Array, Array, list[Value]]:
        """Through points of x and P, or through those that the last prediction kept: what is seen, the array of
        points, conditions of failure."""
        t = u.t
        _ = u.P  # read before the branches
        seen = t.array("seen", self.size)
        if self.kept is None:
            array, failures = self.draw(ukf, u, u.P)
            self.run(u, seen, array)
            return seen, array, failures
        array = t.array("cloud", len(self.points.rows) * self.stride)
        fresh = ~t.wrapped(t.pool.make("field", (), "kf.kept", "bool"))
        with t.when(fresh):
            guards.positive(t, self.redraw(ukf, u, array))
            self.run(u, seen, array)
        with t.when(~fresh):
            assert self.kept.see is not None
            kept = [("kf.points", 0), ("kf.points", self.kept.offset)] if self.kept.offset else [("kf.points", 0)]
            t.call(self.kept.see.function, [*self.kept.see.arguments(None), ("kf.x", 0), *kept, (seen.name, 0)])
        return seen, array, []

    def _noise_root(self, u: Update) -> Rows:
        from kfgen.filters.ukf import noise_root

        C = self.noise_covariance(u)
        root, tested = noise_root(C, self.model.spec.filter.covariance, self.tolerance)
        u.tested += tested
        return root

    def noise_covariance(self, u: Update) -> Rows:
        """Of the carried noises."""
        names = [w.name for w in self.sensor.noises]
        index = [names.index(w) for w in self.carried]
        whole = u.code.noise_covariance() if index else []
        return [[whole[i][j] for j in index] for i in index]

    def run(self, u: Update, seen: Array, array: Array, x: tuple[str, int] = ("kf.x", 0)) -> None:
        """Have `see` fill the array `seen`."""
        assert self.see is not None
        u.t.call(self.see.function, [*self.see.arguments(None), x, (array.name, 0), (seen.name, 0)])

    def read(self, t: Trace, seen: Array) -> Seen:
        """The numbers of the array."""
        m = self.m
        names = [c.name for c in self.sensor.spec.components]
        z = [t.name(seen[a], f"h_{names[a]}") for a in range(m)]
        made: dict[tuple[int, int], Value] = {}
        for b in range(m):
            for a in range(b + 1):
                made[a, b] = seen[m + b * (b + 1) // 2 + a]
        offset = m + m * (m + 1) // 2
        cross = [[seen[offset + i * m + a] for a in range(m)] for i in range(self.stride)]
        return Seen(z, Symmetric(m, lambda a, b: made[a, b]), cross[: self.n], cross[self.n :])

    def residual(self, ukf: Ukf, u: Update, x: list[Value], P: Covariance) -> Vector:
        """z less what points of the new x and P predict."""
        t = u.t
        array, failures = self.draw(ukf, u, P, "_after", stored=False)
        guards.positive(t, failures)
        local, seen = t.array("after", self.n), t.array("seen_after", self.size)
        for i, value in enumerate(x):
            local[i] = value
        self.run(u, seen, array, (local.name, 0))
        return u.code.residuals(x, self.read(t, seen).z, named=False)

    def regression(self, ukf: Ukf, u: Update) -> tuple[Linearised, Symmetric]:
        """H = Pxz^T P^-1, with R as it is; and the spread of the points (sequential filters: U D U^T)."""
        t = u.t
        seen = self.read(t, self.look(ukf, u)[0])
        U, D = u.P
        H = []
        dense = u.layout.entries(u.P)
        known = [dense[j, j] * self.tolerance for j in range(self.n)]  # a pivot up to it is a direction without spread
        for a in range(self.m):
            H.append(_solved(U, D, [seen.cross[i][a] for i in range(self.n)], known))
        linear = replace(u.code.linearise(u.x), y=u.code.residuals(u.x, seen.z), H=H)
        if self.carried:
            V, C = linalg.udu(self.noise_covariance(u))
            none: Vector = [t.zero] * self.q
            rows = [_solved(V, C, [seen.noise[i][a] for i in range(self.q)], none) for a in range(self.m)]
            share = [[t.value(linalg.dot(rows[a], [seen.noise[i][b] for i in range(self.q)])) for b in range(self.m)]
                     for a in range(self.m)]  # fmt: skip
            added = [[p + q for p, q in zip(r, s, strict=True)] for r, s in zip(linear.added, share, strict=True)]
            linear = replace(linear, added=added, computed=True)
        return linear, seen.spread


def _solved(U: Rows, D: Vector, c: Vector, smallest: Vector) -> Vector:
    """(U D U^T)^-1 c; an entry is 0 where D is not above `smallest`."""
    n = len(D)
    v: Vector = list(c)
    for j in reversed(range(n)):
        for i in range(j):
            v[i] = linalg.minus(v[i], times(U[i][j], v[j]))
    inverse = []
    for d, low in zip(D, smallest, strict=True):
        some, reciprocal_d = reciprocal(assume_nonnegative(d))
        inverse.append(reciprocal_d if is_zero(low) else select(some & (d > low), 1 / d, 0))
    v = [times(x, r) for x, r in zip(v, inverse, strict=True)]
    for j in range(n):
        for i in range(j):
            v[j] = linalg.minus(v[j], times(U[i][j], v[i]))
    return v


@dataclass(frozen=True)
class Factored:
    """S = L D L^T and what belongs to it: nu = L^-1 y, the columns of Pxz L^-T (m, n), 1 / D or 0, D or 1."""

    nu: Vector
    columns: list[Vector]
    inverse: Vector
    D: Vector
    some: list[Value | None]  # whether D counts; None: it does
    failures: list[Value]
    nis: Value


def factored(
    t: Trace, names: list[str], y: Vector, S: Rows, cross: Rows, sure: bool, tolerance: Fraction, noise: Vector
) -> Factored:
    """sure: every pivot is known to be positive, but for what a guard finds. noise: what rounding may leave of each
    variance (m,)."""
    m, n = len(y), len(cross)
    rest = [list(row) for row in S]
    nu = list(y)
    columns: list[Vector] = [[cross[i][a] for i in range(n)] for a in range(m)]
    D: Vector = []
    inverse: Vector = []
    some: list[Value | None] = []
    failures: list[Value] = []
    nis: Value = t.zero
    for j in range(m):
        pivot = t.name(rest[j][j], f"s_{names[j]}")
        counts: Value | None = None
        if sure:
            failures.append(~(pivot > 0))
            inverse.append(1 / assume_positive(pivot))
            D.append(pivot)
        else:
            limit = S[j][j] * (tolerance * m) + noise[j]
            failures.append(~(pivot >= -limit))
            counts = (pivot > limit) & (pivot > 0)
            inverse.append(select(counts, 1 / pivot, 0))
            D.append(assume_positive(select(counts, pivot, 1)))
            columns[j] = [select(counts, c, 0) for c in columns[j]]
        some.append(counts)
        for i in range(j + 1, m):
            factor = rest[j][i] * inverse[j]
            for k in range(i, m):
                rest[i][k] = rest[i][k] - factor * rest[j][k]
            nu[i] = nu[i] - factor * nu[j]
            columns[i] = [linalg.minus(c, times(factor, b)) for c, b in zip(columns[i], columns[j], strict=True)]
        nis = nis + nu[j] * (nu[j] * inverse[j])
    return Factored(nu, columns, inverse, D, some, failures, nis)


def whole_vector(ukf: Ukf, seeing: Seeing, taken: frozenset[str], partial: bool) -> Function:
    """The update of a sensor by the whole vector."""
    model, sensor, layout = ukf.model, seeing.sensor, ukf.layout
    t = Trace(ukf.scalar.smallest)
    arguments, used = ukf.opening(t, sensor, partial)
    t.section("innovation")
    code = SensorCode(t, model, sensor, ukf.order, skipped=seeing.carried)
    u = Update(t, sensor, code, code.prior(), layout, used, ukf.adapted_R(sensor))
    failures: list[Value] = []
    array = out = None
    if seeing.linear:
        seen = seeing.analytic(u)
    else:
        out, array, failures = seeing.look(ukf, u)
        seen = seeing.read(t, out)
    linear = code.linearise(u.x)
    work = _Whole(ukf, u, seeing, linear, seen)
    t.section("its covariance S = L D L^T")
    first = work.factored(seen, made=model.options.inflation is None)
    nis = t.name(first.nis, "nis")
    t.section("guards")
    sound = [*work.y(seen), *first.D, *u.tested, *(v for row in work.R for v in row)]
    guards.finite(t, [*sound, nis] if sensor.gate is None else sound)
    guards.doubts(t, [v for row in linear.R for v in row])
    guards.positive(t, [*failures, *first.failures])
    gate(t, model, sensor, nis, used)
    P = u.P
    final = first
    if model.options.inflation is not None:
        P, final = work.inflated(seen, first, array, out)
    t.section("gain and covariance")
    failed: list[Value] = [] if final is first else list(final.failures)
    sure = work.sure
    moved: Vector = [0] * ukf.n
    likelihood: Value = t.zero
    for j in range(seeing.m):
        c = [final.columns[j][place] for place in ukf.order]
        P, bad = layout.downdated(t, P, c, final.D[j], ukf.tolerance, sure)
        if not work.definite:  # else it can only be round-off, and has been taken for zero
            failed.append(bad)
        step = final.nu[j] * final.inverse[j]
        moved = [plus(a, times(b, step)) for a, b in zip(moved, c, strict=True)]
        term = final.nu[j] * step + t.function("log", final.D[j]) + t.value(log_two_pi())
        counts = final.some[j]
        if used is not None:
            counts = used[j] if counts is None else counts & used[j]
        likelihood = likelihood + (term if counts is None else t.select(counts, term, 0))
    t.section("state")
    x = ukf.moved(u, moved)
    evidence = ukf.unconfined(x) + layout.evidence(P, after_predict=False)
    P = ukf.limited(t, P)
    x = ukf.state.confined(t, x)
    t.section("guards")
    guards.finite(t, [nis, *x, *evidence])
    if not layout.factored and not work.definite:
        from kfgen.filters.gather import indefinite

        failed += indefinite(P, ukf.n * ukf.scalar.epsilon)
    guards.positive(t, failed)
    made = Updated(moved, P, nis, list(final.D), [], likelihood * Fraction(-1, 2), [])
    ukf.store_update(u, x, P, made, made)
    suffix, what = ("_masked", "the chosen components of a measurement") if partial else ("", "a measurement")
    return Function(
        f"update_{sensor.name}{suffix}", arguments, schedule(t, taken | {a.name for a in arguments}),
        f"Take {what} of {sensor.name} into account.",
    )  # fmt: skip


class _Whole:
    """The pieces of a whole-vector update that are made twice where P is inflated."""

    def __init__(self, ukf: Ukf, u: Update, seeing: Seeing, linear: Linearised, seen: Seen) -> None:
        self.ukf = ukf
        self.u = u
        self.seeing = seeing
        m = seeing.m
        R: Rows = linear.R
        if u.adapted is not None:
            adapted = u.adapted.adapted(u.t, seen.spread, u.used)
            R = [[adapted[i, j] for j in range(m)] for i in range(m)]
        self.R: Rows = [[R[i][j] + linear.added[i][j] for j in range(m)] for i in range(m)]
        if u.adapted is None and any(r.constant is None for row in self.R for r in row):
            for d in decorrelated(u.t, linear, self.R).variances:
                require_nonnegative(d, "R is not positive semidefinite")
        diagonal = all(is_zero(self.R[i][j]) for i in range(m) for j in range(m) if i != j)
        self.definite = seeing.points.positive and seeing.points.exact
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
            R = [[select(used[i] & used[j], R[i][j], t.one if i == j else t.zero) for j in range(m)] for i in range(m)]
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
        names = [c.name for c in self.seeing.sensor.spec.components]
        epsilon = self.ukf.scalar.epsilon
        # points differ from each other by the rounding of what h is made of, if by nothing else
        total = sum(abs(w) for w in self.seeing.points.wc) * (32 * epsilon) ** 2
        noise: Vector = [0 if self.sure or self.seeing.linear else z * z * total for z in seen.z]
        return factored(t, names, self.y(seen), S, cross, self.sure, 8 * epsilon, noise)

    def inflated(
        self, seen: Seen, first: Factored, array: Array | None, out: Array | None
    ) -> tuple[Covariance, Factored]:
        """P <- (1 + a) P where the innovation fails its test, and all that follows from it."""
        t, u, seeing = self.u.t, self.u, self.seeing
        inflation = self.ukf.model.options.inflation
        assert inflation is not None
        t.section("adaptive: is the innovation within its quantile?")
        threshold = inflation.threshold
        limit = chi2_threshold(t, inflation.probability, seeing.m, u.used) if threshold is None else t.value(threshold)
        known = Fraction(1, 10**12) if self.ukf.scalar.name == "double" else Fraction(1, 10**6)
        terms = _known_squares(t, self.y(seen), self.spread(seen), first.D, first.some, known)
        fails = t.name(first.nis > limit, "anomaly")
        t.flag(fails, "ANOMALY")
        a = terms * (1 / limit - reciprocal(assume_nonnegative(first.nis))[1])
        factor = assume_positive(t.name(select(fails, 1 + a, t.one), "inflation"))
        P = self.ukf.layout.inflated(u.P, factor)
        if array is None or out is None:
            m = seeing.m
            again = Seen(seen.z, Symmetric(m, lambda i, j: seen.spread[i, j] * factor),
                         [[times(c, factor) for c in row] for row in seen.cross], [])  # fmt: skip
            return P, self.factored(again)
        root = t.name(sqrt(factor), "root_inflation")
        with t.when(fails):
            if seeing.kept is not None:
                guards.positive(t, seeing.redraw(self.ukf, u, array))
            with t.loop("k", 0, len(seeing.points.rows)) as k:
                for i in range(seeing.n):
                    array[k * seeing.stride + i] = array[k * seeing.stride + i] * root
            seeing.run(u, out, array)
        return P, self.factored(seeing.read(t, out))


def _known_squares(t: Trace, y: Vector, S: Rows, D: Vector, some: list[Value | None], known: Fraction) -> Value:
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
