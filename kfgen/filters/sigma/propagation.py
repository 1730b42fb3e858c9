"""The prediction of a sigma-point filter: points through f, their mean and their spread."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.noise import Given
from kfgen.filters.covariance.parts import Gatherer, Gathering
from kfgen.filters.frame import guards
from kfgen.filters.kinds.single import SingleFilter
from kfgen.filters.sigma import cloud
from kfgen.filters.sigma.carried import images_of_process
from kfgen.filters.sigma.cloud import Private
from kfgen.filters.sigma.drawing import Drawing, noise_root
from kfgen.filters.sigma.points import PointSet
from kfgen.filters.steps import process
from kfgen.filters.steps.phases import Made, Phases
from kfgen.filters.steps.process import Step
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.scalars import Scalar


class Propagation:
    """Points of (x, P) and of the carried noises through f. f: the model's step as a private function. absorb: the
    private function by which factors take a column in, where that is done in loops."""

    def __init__(
        self, model: Model, form: Form[Any], scalar: Scalar, points: PointSet, carried: tuple[str, ...],
        drawing: Drawing, f: Private, absorb: Function | None,
    ) -> None:  # fmt: skip
        self.model = model
        self.form = form
        self.scalar = scalar
        self.points = points
        self.carried = carried
        self.drawing = drawing
        self.f = f
        self.absorb = absorb
        self.n = len(model.states)
        self.parts = images_of_process(model)

    def predicting(self, filter_: SingleFilter, t: Trace, step: Step) -> Phases:
        """The step from the estimate in the struct. filter_: it limits and stores what comes out."""
        model = self.model
        prior = process.given(t, model, step)
        result = process.advance(t, model, prior, step, carried=self.carried)
        P0 = self.form.load(t)
        t.section("sigma points")
        noise, tested = self._noise_root(t, prior.duals)
        stride = self.n + len(self.carried)
        array = t.array("points", len(self.points.rows) * stride)
        failures = self.drawing.around(t, P0, noise, self.points, array, prior.x)
        x, P, failed, shift = self._propagated(t, array, stride, prior.x, result, step, bool(filter_.outdated))
        failures += failed
        for value, name in zip(x, model.states, strict=True):
            t.name(value, f"{name}_next")
        evidence = filter_.unconfined(x) + self.form.evidence(P, after_predict=True)
        raised = len(t.raised)
        P = filter_.limited(t, P)
        limits = [condition for condition, _ in t.raised[raised:]]
        free = x
        x = filter_.state.confined(t, x)
        t.section("guards")
        doubtful = [v for row in result.Q for v in row] + [d for _, d in result.noise]
        guards.doubts(t, [*x, *doubtful, *tested])
        guards.finite(t, [*x, *evidence, *tested])
        guards.positive(t, failures)
        yield Made(x, P)
        filter_.store(t, x, set(range(self.n)), P, after_predict=True)
        if filter_.outdated:
            self._keep(t, array, shift, free, x, limits)

    def _noise_root(self, t: Trace, duals: dict[str, Dual]) -> tuple[Rows, list[Value]]:
        evaluator = Evaluator(t, self.model, duals)
        names = [w.name for w in self.model.noises]
        index = [names.index(w) for w in self.carried]
        C = [[evaluator.value(self.model.noise_covariance[i][j]) for j in index] for i in index]
        return noise_root(C, self.model.spec.filter.covariance, self.drawing.tolerance)

    def _propagated(
        self, t: Trace, array: Array, stride: int, x: list[Value], result: process.Advance, step: Step, keep: bool
    ) -> tuple[list[Value], Any, list[Value], list[Value]]:
        """The mean, the covariance, conditions of failure, and the mean's shift from the centre's image. keep: the
        array is to hold the deviations."""
        model, n, points, f = self.model, self.n, self.points, self.f
        count = len(points.rows)
        if points.centre or not all(part.flat for part in self.parts):
            base_array = t.array("centre", stride)
            for i in range(stride):
                base_array[i] = x[i] if i < n else t.zero
            t.call(f.function, [*f.arguments(step.dt), ("centre", 0)])
            base = [t.name(cloud.clipped(t, base_array[i], model.bounds[i]), f"{model.states[i]}_centre")
                    for i in range(n)]  # fmt: skip
        else:
            base = x  # any base does
        sums = [t.variable(f"shift_{name}", 0) for name in model.states]
        names = [model.states[i] for i in self.form.order]
        Q = Given([[result.Q[i][j] for j in self.form.order] for i in self.form.order])
        noise = [([w[i] for i in self.form.order], d) for w, d in result.noise]
        common = points.wc[0] if points.uniform else None
        in_loops = self.drawing.in_loops
        how = Gathering(names, common, self.scalar.epsilon, in_loops, self.absorb, checked=not points.positive)
        gather = self.form.gatherer(t, Q, noise, how)
        self.rewritten = gather.rewrites and points.theta != 0
        t.section("points through f, and their deviations")
        with t.loop("k", 0, count) as k:
            at = k * stride
            t.call(f.function, [*f.arguments(step.dt), ("points", at)])
            rejected = self._rejected(t, array, at, step)
            deviations = []
            for i, part in enumerate(self.parts):
                d = part.local(cloud.clipped(t, array[at + i], model.bounds[i]), base[i])
                if rejected is not None:
                    d = t.select(rejected, t.zero, d)
                deviations.append(t.name(d, f"dev_{model.states[i]}"))
            if gather.rewrites or points.theta or keep:
                for i, d in enumerate(deviations):
                    array[at + i] = d
            weight = cloud.weights(t, points.wm, k, "wm")
            for variable, d in zip(sums, deviations, strict=True):
                variable.set(variable.get() + (d if points.uniform else weight * d))
            if points.theta == 0:
                inner = [deviations[i] for i in self.form.order]
                gather.add_row(array, at, inner, common or cloud.weights(t, points.wc, k, "wc"))
        scale = points.wm[0] if points.uniform else Fraction(1)
        shift = [t.name(s.get() * scale, f"mean_{name}") for s, name in zip(sums, model.states, strict=True)]
        inner = [shift[i] for i in self.form.order]
        if points.theta:
            t.section("deviations from the mean")
            self._about_mean(t, gather, array, stride, inner, common)
        if points.extra > 0:
            gather.add(inner, points.extra)
        elif points.extra < 0:
            gather.subtract(inner, -points.extra)
        P, failures = gather.result()
        return [b + s for b, s in zip(base, shift, strict=True)], P, failures, shift

    def _about_mean(
        self, t: Trace, gather: Gatherer[Any], array: Array, stride: int, inner: Vector, common: Fraction | None
    ) -> None:
        """Gather deviations less the mean's shift; those of negative weight last."""
        points, order = self.points, self.form.order
        positive = sum(1 for w in points.wc if w >= 0)
        for start, stop in ((0, positive), (positive, len(points.rows))):
            if start == stop:
                continue
            with t.loop("k", start, stop) as k:
                at = k * stride
                weight = common or cloud.weights(t, points.wc, k, "wc")
                d: Vector = []
                for i, s in zip(order, inner, strict=True):
                    d.append(array[at + i] - s)
                    if gather.rewrites:
                        array[at + i] = d[-1]
                if start == 0:
                    gather.add_row(array, at, d, weight)
                else:
                    gather.subtract_row(array, at, d, -weight)

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
        first = self.n if self.points.centre else 0
        offset = [s + (v - f) if part.flat and not is_zero(f - v) else s
                  for s, f, v, part in zip(shift, free, x, self.model.parts, strict=True)]  # fmt: skip
        for i, s in enumerate(offset):
            if first:
                t.store("kf.points", i, -s)
        with t.loop("k", 0, len(self.points.rows)) as k:
            for i, (s, mean) in enumerate(zip(offset, shift, strict=True)):
                done = mean if self.rewritten else t.zero  # what it is less already
                d = array[k * (self.n + len(self.carried)) + i] - (s - done)
                t.store("kf.points", k * self.n + (i + first), d)
        limited = t.wrapped(t.pool.boolean(False))
        for condition in limits:
            limited = limited | condition
        t.store("kf.kept", None, ~limited)
