"""The unscented Kalman filter (Julier & Uhlmann 2004; van der Merwe 2004; Sarkka & Svensson 2023, 8.8).

predict: sigma points of (x, P), and of the noise inputs that do not enter linearly, through f.
update: see `unscented`; a linear h needs no points, and the update is then that of the ekf.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import cast

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import KF, Block
from kfgen.filters.covariance.base import Covariance, Layout, Rolled
from kfgen.filters.covariance.full.loops import RolledFull
from kfgen.filters.covariance.gather import Gatherer, gatherer, noise_root
from kfgen.filters.covariance.noise import Given
from kfgen.filters.frame import guards
from kfgen.filters.kinds.ekf import Ekf, Learnt, Update
from kfgen.filters.sigma import cloud, rolled
from kfgen.filters.sigma.cloud import Private
from kfgen.filters.sigma.gathered import Gathered, definite, gathered, scatter
from kfgen.filters.sigma.points import PointSet, point_set
from kfgen.filters.sigma.seeing import Seeing
from kfgen.filters.sigma.update import whole_vector
from kfgen.filters.steps import process
from kfgen.filters.steps.phases import Made, Phases
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.sensor import Linearised
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.scalars import Scalar


class Ukf(Ekf):
    """Emits a ukf over any layout."""

    title = "Unscented Kalman filter"

    def __init__(self, model: Model, layout: Layout, scalar: Scalar) -> None:
        options = model.options.points
        assert options is not None
        self.points = options
        self.n = len(model.states)
        self.tolerance = 8 * self.n * scalar.epsilon
        self.keeps = not options.redraw
        self.own = options.kind == "custom"
        self.carried = () if self.own else _carried_by_process(model)
        self.set = point_set(options, self.n + len(self.carried))
        self.seeing = {sensor.name: self._seeing(model, sensor, scalar) for sensor in model.sensors}
        self.simple = self._simple(model)
        super().__init__(model, layout, scalar)

    def _seeing(self, model: Model, sensor: SensorModel, scalar: Scalar) -> Seeing:
        carried = () if self.own or self.keeps else _carried_by_sensor(model, sensor)
        points = point_set(self.points, self.n + len(carried))
        return Seeing(model, sensor, points, carried, self.tolerance, self.set if self.keeps else None)

    def _simple(self, model: Model) -> bool:
        """Whether f is linear, so that F P F^T is what points would give."""
        plain = not self.keeps and not self.carried and self.set.exact and not model.options.rejects
        if not plain or any(p is not None for p in (*model.periods, *model.bounds)):
            return False
        t = Trace()
        step = process.step_length(t, model)
        result = process.advance(t, model, process.given(t, model, step), step)
        return not cloud.bends(result.x, [v for row in result.F for v in row])

    def extra_blocks(self) -> list[Block]:
        if not self.keeps:
            return []
        size = (len(self.set.rows) + self.set.centre) * self.n
        return [
            Block("points", size, "sigma points less x, of the last prediction", initial=(Fraction(0),) * size),
            Block("kept", None, "whether they belong to x and the covariance", kind="bool"),
        ]

    @property
    def outdated(self) -> str:
        return "kf.kept" if self.keeps else ""

    def description(self) -> str:
        chosen = self.model.spec.filter
        form = "sequential update" if chosen.sequential else "update by the whole vector"
        options = [key for key in ("robust", "adaptive", "adapt_R") if getattr(chosen, key) is not None]
        text = f"{self.title}, {self.points.kind} points, {self.layout.title} covariance, {form}"
        return text + "".join(f", {key}" for key in options)

    def private_functions(self, taken: frozenset[str]) -> list[Function]:
        made: list[Function] = []
        self.f: Private | None = None
        if not self.simple:
            self.f = cloud.dynamics(self.model, self.carried, taken)
            made.append(self.f.function)
        self.absorb: Function | None = None
        if self.loops and self.layout.factored and not self.simple:
            self.absorb = rolled.absorb(self.n, self.scalar.smallest, taken)
            made.append(self.absorb)
        for seeing in self.seeing.values():
            made += seeing.functions(taken)
        return made

    def further_functions(self, taken: frozenset[str]) -> list[Function]:
        if not self.keeps:
            return []
        t = Trace()
        t.store("kf.kept", None, t.wrapped(t.pool.boolean(False)))
        doc = "Have the next update draw its points anew from x and the covariance."
        return [Function("redraw", [KF], schedule(t, taken), doc)]

    def remarks(self) -> tuple[str, ...]:
        out = ["f is linear: no sigma points"] if self.simple else []
        linear = [name for name, seeing in self.seeing.items() if seeing.linear]
        return (*out, *(f"h of {name} is linear: no sigma points" for name in linear))

    # predict -----------------------------------------------------------------------------------------

    def predicting(self, t: Trace, step: Step) -> Phases:
        """Points through f; x <- their mean, P <- their spread + Q + G Qw G^T of the noises that they do not carry."""
        if self.simple or self.plain.rolled:
            with self._without_points():
                yield from super().predicting(t, step) if self.simple else self._predicting(t, step)
        else:
            yield from self._predicting(t, step)

    def _predicting(self, t: Trace, step: Step) -> Phases:
        model = self.model
        prior = process.given(t, model, step)
        result = process.advance(t, model, prior, step, carried=self.carried)
        P0 = self.layout.load(t)
        t.section("sigma points")
        noise, tested = self._noise_root(t, prior.duals)
        stride = self.n + len(self.carried)
        array = t.array("points", len(self.set.rows) * stride)
        failures = self.scatter(t, P0, noise, self.set, array)
        x, P, failed, shift = self._propagated(t, array, stride, prior.x, result, step)
        failures += failed
        for value, name in zip(x, model.states, strict=True):
            t.name(value, f"{name}_next")
        evidence = self.unconfined(x) + self.layout.evidence(P, after_predict=True)
        raised = len(t.raised)
        P = self.limited(t, P)
        limits = [condition for condition, _ in t.raised[raised:]]
        free = x
        x = self.state.confined(t, x)
        t.section("guards")
        doubtful = [v for row in result.Q for v in row] + [d for _, d in result.noise]
        guards.doubts(t, [*x, *doubtful, *tested])
        guards.finite(t, [*x, *evidence, *tested])
        guards.positive(t, failures)
        if isinstance(self.layout, RolledFull) and not self.set.positive:
            P = definite(self.layout, P, self.n * self.scalar.epsilon)
        yield Made(x, P)
        self.store(t, x, set(range(self.n)), P, after_predict=True)
        if self.keeps:
            self._keep(t, array, shift, free, x, limits)

    @property
    def loops(self) -> bool:
        """Whether loops do what grows with the square of the states: all of it, or what then pays."""
        many = self.n >= rolled.FROM and self.model.spec.code.unroll != "full"
        return self.plain.rolled or (many and not self.own and self.set.extra >= 0)

    @property
    def predicts_in_loops(self) -> bool:
        return self.loops and not self.simple

    def scatter(
        self, t: Trace, P: Covariance, noise: Rows, points: PointSet, array: Array, stored: bool = True
    ) -> list[Value]:
        """Write points of P into the array; conditions of failure. stored: P is that of the struct."""
        if self.loops and (stored or self.layout.rolled):
            own = None if stored else cast(Rolled, self.layout).placed(P)
            root = rolled.root(t, self.layout, self.tolerance, own)
            if self.own:
                scatter(t, array, points, root, self.n)
            else:
                rolled.scatter(t, array, points, root, self.n, noise)
            return []
        columns, failures = self.root(t, P, noise)
        cloud.fill(t, array, points, columns)
        return failures

    def root(self, t: Trace, P: Covariance, noise: Rows) -> tuple[list[Vector], list[Value]]:
        """Columns (n + q) of a root of P, in the spec's order, and of the noises'; conditions of failure."""
        columns, failures = self.layout.root(P, self.tolerance)
        out: list[Vector] = []
        q = len(noise)
        for column in columns:
            straight: Vector = [0] * self.n
            for place, value in zip(self.order, column, strict=True):
                straight[place] = value
            out.append([*straight, *[0] * q])
        for j in range(q):
            out.append([*[0] * self.n, *[noise[i][j] for i in range(q)]])
        return [[v if isinstance(v, Value) else t.value(v) for v in column] for column in out], failures

    def _noise_root(self, t: Trace, duals: dict[str, Dual]) -> tuple[Rows, list[Value]]:
        evaluator = Evaluator(t, self.model, duals)
        names = [w.name for w in self.model.noises]
        index = [names.index(w) for w in self.carried]
        C = [[evaluator.value(self.model.noise_covariance[i][j]) for j in index] for i in index]
        return noise_root(C, self.model.spec.filter.covariance, self.tolerance)

    def _propagated(
        self, t: Trace, array: Array, stride: int, x: list[Value], result: process.Advance, step: Step
    ) -> tuple[list[Value], Covariance, list[Value], list[Value]]:
        """The mean, the covariance, conditions of failure, and the mean's shift from the centre's image."""
        model, n, points, f = self.model, self.n, self.set, self.f
        assert f is not None
        count = len(points.rows)
        if points.centre or any(p is not None for p in model.periods):
            base_array = t.array("centre", stride)
            for i in range(stride):
                base_array[i] = x[i] if i < n else t.zero
            t.call(f.function, [*f.arguments(step.dt), ("centre", 0)])
            base = [t.name(cloud.clipped(t, base_array[i], model.bounds[i]), f"{model.states[i]}_centre")
                    for i in range(n)]  # fmt: skip
        else:
            base = x  # any base does where nothing is periodic
        sums = [t.variable(f"shift_{name}", 0) for name in model.states]
        names = [model.states[i] for i in self.order]
        Q = Given([[result.Q[i][j] for j in self.order] for i in self.order])
        noise = [([w[i] for i in self.order], d) for w, d in result.noise]
        common = points.wc[0] if points.uniform else None
        gather: Gatherer | rolled.Entries | rolled.Factors | Gathered
        if self.layout.rolled:
            gather = gathered(t, self.layout, Q, noise, common, self.absorb, self.scalar.epsilon)
        elif self.loops:
            assert common is not None
            if self.absorb is None:
                gather = rolled.Entries(t, self.layout, Q, noise, common)
            else:
                gather = rolled.Factors(t, self.layout, Q, noise, common, self.absorb)
        else:
            gather = gatherer(t, self.layout, Q, noise, names, common, self.scalar.epsilon, not points.positive)
        t.section("points through f; deviations overwrite them")
        with t.loop("k", 0, count) as k:
            at = k * stride
            for i in range(n):
                array[at + i] = array[at + i] + x[i]
            t.call(f.function, [*f.arguments(step.dt), ("points", at)])
            rejected = self._rejected(t, array, at, step)
            deviations = []
            for i, period in enumerate(model.periods):
                d = cloud.clipped(t, array[at + i], model.bounds[i]) - base[i]
                if period is not None:
                    d = t.wrap(d, period)
                if rejected is not None:
                    d = t.select(rejected, t.zero, d)
                deviations.append(t.name(d, f"dev_{model.states[i]}"))
            for i, d in enumerate(deviations):
                array[at + i] = d
            weight = cloud.weights(t, points.wm, k, "wm")
            for variable, d in zip(sums, deviations, strict=True):
                variable.set(variable.get() + (d if points.uniform else weight * d))
            if points.theta == 0 and isinstance(gather, Gathered):
                gather.add_row(array, at, common or cloud.weights(t, points.wc, k, "wc"))
            elif points.theta == 0 and isinstance(gather, rolled.Entries | rolled.Factors):
                gather.add_row(array, at)
            elif points.theta == 0:
                gather.add([deviations[i] for i in self.order], common or cloud.weights(t, points.wc, k, "wc"))
        scale = points.wm[0] if points.uniform else Fraction(1)
        shift = [t.name(s.get() * scale, f"mean_{name}") for s, name in zip(sums, model.states, strict=True)]
        inner = [shift[i] for i in self.order]
        if points.theta:
            t.section("deviations from the mean")
            self._about_mean(t, gather, array, stride, inner, common)
        if points.extra > 0:
            gather.add(inner, points.extra)
        elif points.extra < 0 and not isinstance(gather, rolled.Entries | rolled.Factors):
            gather.subtract(inner, -points.extra)
        P, failures = gather.result()
        return [b + s for b, s in zip(base, shift, strict=True)], P, failures, shift

    def _about_mean(
        self, t: Trace, gather: Gatherer | rolled.Entries | rolled.Factors | Gathered, array: Array, stride: int,
        inner: Vector, common: Fraction | None,
    ) -> None:
        """Gather deviations less the mean's shift; those of negative weight last."""
        points = self.set
        positive = sum(1 for w in points.wc if w >= 0)
        for start, stop in ((0, positive), (positive, len(points.rows))):
            if start == stop:
                continue
            with t.loop("k", start, stop) as k:
                at = k * stride
                weight = common or cloud.weights(t, points.wc, k, "wc")
                if isinstance(gather, rolled.Entries | rolled.Factors | Gathered):
                    for i, s in zip(self.order, inner, strict=True):
                        array[at + i] = array[at + i] - s
                    if not isinstance(gather, Gathered):
                        gather.add_row(array, at)
                    elif start == 0:
                        gather.add_row(array, at, weight)
                    else:
                        gather.subtract_row(array, at, -weight)
                    continue
                d = [array[at + i] - s for i, s in zip(self.order, inner, strict=True)]
                if start == 0:
                    gather.add(d, weight)
                else:
                    gather.subtract(d, -weight)

    def _rejected(self, t: Trace, array: Array, at: Value, step: Step) -> Value | None:
        """Whether the image of a point is replaced by that of the centre."""
        options, model = self.model.options, self.model
        if not options.rejects:
            return None
        image = [array[at + i] for i in range(self.n)]
        wild = t.wrapped(t.pool.boolean(False))
        for value in image:
            wild = wild | ~t.finite(value)
        if options.reject is not None:
            duals = {name: Dual(value) for name, value in zip(model.states, image, strict=True)}
            duals.update(process.parameters_and_inputs(t, model))
            if model.uses_time():
                duals["t"] = process.time_now(t, model)
            if step.dt is not None:
                duals["dt"] = Dual(step.dt)
            wild = wild | Evaluator(t, model, duals).value(options.reject)
        t.flag(t.name(wild, "rejected"), "POINT_REJECTED")
        return wild

    def _keep(
        self, t: Trace, array: Array, shift: list[Value], free: list[Value], x: list[Value], limits: list[Value]
    ) -> None:
        """Store the points, less x; not those of a covariance that a floor or ceiling has changed."""
        first = self.n if self.set.centre else 0
        offset = [s if is_zero(f - v) or p is not None else s + (v - f)
                  for s, f, v, p in zip(shift, free, x, self.model.periods, strict=True)]  # fmt: skip
        for i, s in enumerate(offset):
            if first:
                t.store("kf.points", i, -s)
        with t.loop("k", 0, len(self.set.rows)) as k:
            for i, (s, mean) in enumerate(zip(offset, shift, strict=True)):
                done = mean if self.loops and self.set.theta else t.zero  # what it is less already
                d = array[k * (self.n + len(self.carried)) + i] - (s - done)
                t.store("kf.points", k * self.n + (i + first), d)
        limited = t.wrapped(t.pool.boolean(False))
        for condition in limits:
            limited = limited | condition
        t.store("kf.kept", None, ~limited)

    # update ------------------------------------------------------------------------------------------

    def updating(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
        seeing = self.seeing[sensor.name]
        chosen = self.model.spec.filter
        several = len(sensor.h) > 1 and self.model.options.innovation_floor is not None
        whole = not chosen.sequential and (chosen.adaptive is not None or several)
        if self.plain.rolled or (seeing.linear and not whole):
            with self._without_points():
                if chosen.sequential or (seeing.linear and not whole):
                    yield from super().updating(t, sensor, used)
                else:
                    yield from whole_vector(self, seeing, t, sensor, used)
        elif chosen.sequential:
            yield from super().updating(t, sensor, used)
        else:
            yield from whole_vector(self, seeing, t, sensor, used)

    @contextmanager
    def _without_points(self) -> Iterator[None]:
        """What is linear needs only what an ekf needs of a layout."""
        points, self.layout = self.layout, self.plain
        try:
            yield
        finally:
            self.layout = points

    def skipped(self, sensor: SensorModel) -> tuple[str, ...]:
        return self.seeing[sensor.name].carried

    def linearise(self, u: Update) -> Linearised:
        seeing = self.seeing[u.sensor.name]
        if seeing.linear:
            return super().linearise(u)
        linear, self._spread = seeing.regression(self, u)
        return linear

    def spread(self, u: Update, linear: Linearised) -> Symmetric:
        return super().spread(u, linear) if self.seeing[u.sensor.name].linear else self._spread

    def store_update(self, u: Update, x: list[Value], P: Covariance, learnt: Learnt) -> None:
        super().store_update(u, x, P, learnt)
        if self.keeps:
            u.t.store("kf.kept", None, u.t.wrapped(u.t.pool.boolean(False)))

    def residual_after(self, u: Update, x: list[Value], P: Covariance) -> Vector:
        seeing = self.seeing[u.sensor.name]
        if seeing.linear:
            return super().residual_after(u, x, P)
        return seeing.residual(self, u, x, P)


def _carried_by_process(model: Model) -> tuple[str, ...]:
    t = Trace()
    held = [w.name for w in model.noises if not w.density]
    step = process.step_length(t, model)
    prior = process.given(t, model, step)
    duals = {**prior.duals, **cloud.symbolic_noises(t, held)}
    result = process.advance(t, model, process.Prior(prior.x, duals), step)
    index = [i for i, w in enumerate(model.noises) if not w.density]
    C = tuple(tuple(model.noise_covariance[i][j] for j in index) for i in index)
    return cloud.carried_by(model, result.after, held, C, model.spec.filter.augment)


def _carried_by_sensor(model: Model, sensor: SensorModel) -> tuple[str, ...]:
    names = [w.name for w in sensor.noises]
    if not names:
        return ()
    t = Trace()
    used = model.uses(*sensor.h)
    x = {name: Dual(t.element("kf.x", i), {name: t.one}) for i, name in enumerate(model.states)}
    duals = {**x, **cloud.symbolic_noises(t, names), **process.parameters_and_inputs(t, model)}
    if "t" in used:
        duals["t"] = process.time_now(t, model)
    if model.dt is not None:
        duals["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, duals)
    after = [evaluator(e) for e in sensor.h]
    return cloud.carried_by(model, after, names, sensor.noise_covariance, model.spec.filter.augment)

