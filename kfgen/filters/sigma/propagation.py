"""The prediction of a sigma-point filter: points through f, their mean and their spread."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.linalg import Rows, Vector, dot
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.noise import Additive, Given
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
from kfgen.filters.steps.resetting import moving
from kfgen.geometry import Turn
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
        self.n = len(model.errors)
        self.images = images_of_process(model)
        self.turning = bool(model.rotations)

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
        if self.turning:
            failures = self.drawing.scatter(t, P0, noise, self.points, array)
        else:
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
        filter_.store(t, x, set(range(len(x))), P, after_predict=True)
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
        if self.turning:
            base = [t.name(value, f"{name}_centre") for value, name in zip(result.x, model.states, strict=True)]
            for name, values in (("start", x), ("centre", base)):
                local = t.array(name, len(values))
                for i, value in enumerate(values):
                    local[i] = value
        elif points.centre or not self.images.flat:
            base_array = t.array("centre", stride)
            for i in range(stride):
                base_array[i] = x[i] if i < n else t.zero
            t.call(f.function, [*f.arguments(step.dt), ("centre", 0)])
            base = [t.name(cloud.clipped(t, base_array[i], model.bounds[i]), f"{model.states[i]}_centre")
                    for i in range(n)]  # fmt: skip
        else:
            base = x  # any base does
        sums = [t.variable(f"shift_{name}", 0) for name in model.errors]
        names = [model.errors[i] for i in self.form.order]
        Q = Given([[result.Q[i][j] for j in self.form.order] for i in self.form.order])
        noise = [([w[i] for i in self.form.order], d) for w, d in result.noise]
        later = Q, noise
        if self.turning:  # in the tangent at the mean, to which the rest is moved first
            Q, noise = Given([[t.zero] * n for _ in range(n)]), []
        common = points.wc[0] if points.uniform else None
        in_loops = self.drawing.in_loops
        how = Gathering(names, common, self.scalar.epsilon, in_loops, self.absorb, checked=not points.positive)
        gather = self.form.gatherer(t, Q, noise, how)
        self.rewritten = gather.rewrites and points.theta != 0
        t.section("points through f, and their deviations")
        with t.loop("k", 0, count) as k:
            at = k * stride
            ends: list[str | tuple[str, int | Value] | Value] = [("points", at)]
            if self.turning:
                ends = [("start", 0), ("centre", 0), ("points", at)]
            t.call(f.function, [*f.arguments(step.dt), *ends])
            image = [array[at + i] for i in range(n)]
            if self.turning:
                apart = image
                image = self.images.retract(base, apart) if model.options.rejects else []
            else:
                apart = [part.local(cloud.clipped(t, image[i], model.bounds[i]), base[i])
                         for i, _, part in self.images.singles]  # fmt: skip
            rejected = self._rejected(t, image, step)
            deviations = []
            for d, name in zip(apart, model.errors, strict=True):
                if rejected is not None:
                    d = t.select(rejected, t.zero, d)
                deviations.append(t.name(d, f"dev_{name}"))
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
        shift = [t.name(s.get() * scale, f"mean_{name}") for s, name in zip(sums, model.errors, strict=True)]
        inner = [shift[i] for i in self.form.order]
        if points.theta:
            t.section("deviations from the mean")
            self._about_mean(t, gather, array, stride, inner, common)
        if points.extra > 0:
            gather.add(inner, points.extra)
        elif points.extra < 0:
            gather.subtract(inner, -points.extra)
        P, failures = gather.result()
        if self.turning:
            x, P = self._turned(t, base, shift, P, *later)
            return x, P, failures, shift
        return [b + s for b, s in zip(base, shift, strict=True)], P, failures, shift

    def _turned(
        self, t: Trace, base: list[Value], shift: list[Value], P: Any, Q: Additive, noise: list[tuple[Vector, Value]]
    ) -> tuple[list[Value], Any]:
        """The mean base [+] shift, and P as it is seen from there, with what the noises add."""
        model, x = self.model, list(base)
        for i, j, _ in model.space.singles:
            x[i] = base[i] + shift[j]
        turns = []
        for r in model.rotations:
            turn = Turn(shift[r.first_error : r.first_error + 3])
            x[r.first : r.first + 4] = r.geometry.turned(base[r.first : r.first + 4], turn)
            turns.append((r, turn))
        self.seen_from = moving(t, model, self.form.order, turns)
        t.section("as seen from the mean, and the noise")
        return x, self.form.turned(t, P, self.seen_from, Q, noise)

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

    def _rejected(self, t: Trace, image: list[Value], step: Step) -> Value | None:
        """Whether the image of a point is replaced by that of the centre."""
        options, model = self.model.options, self.model
        if not options.rejects:
            return None
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
        offset = list(shift)
        for i, j, part in self.model.space.singles:
            if part.flat and not is_zero(free[i] - x[i]):
                offset[j] = shift[j] + (x[i] - free[i])
        if self.turning:
            self._keep_turned(t, array, offset, shift, first)
            self._keep_unless(t, limits)
            return
        for i, s in enumerate(offset):
            if first:
                t.store("kf.points", i, -s)
        with t.loop("k", 0, len(self.points.rows)) as k:
            for i, (s, mean) in enumerate(zip(offset, shift, strict=True)):
                done = mean if self.rewritten else t.zero  # what it is less already
                d = array[k * (self.n + len(self.carried)) + i] - (s - done)
                t.store("kf.points", k * self.n + (i + first), d)
        self._keep_unless(t, limits)

    def _keep_turned(self, t: Trace, array: Array, offset: list[Value], shift: list[Value], first: int) -> None:
        """The same of errors, as they are seen from the mean."""
        T, place = self.seen_from, {i: k for k, i in enumerate(self.form.order)}

        def seen(d: list[Value]) -> list[Value]:
            out = list(d)
            for r in self.model.rotations:
                index = range(r.first_error, r.first_error + 3)
                for i in index:
                    out[i] = t.value(dot([T[place[i]][place[j]] for j in index], [d[j] for j in index]))
            return out

        if first:
            for i, value in enumerate(seen([-s for s in offset])):
                t.store("kf.points", i, value)
        with t.loop("k", 0, len(self.points.rows)) as k:
            at = k * (self.n + len(self.carried))
            own = []
            for i, (s, mean) in enumerate(zip(offset, shift, strict=True)):
                done = mean if self.rewritten else t.zero  # what it is less already
                own.append(t.name(array[at + i] - (s - done), f"left_{self.model.errors[i]}"))
            for i, value in enumerate(seen(own)):
                t.store("kf.points", k * self.n + (i + first), value)

    def _keep_unless(self, t: Trace, limits: list[Value]) -> None:
        limited = t.wrapped(t.pool.boolean(False))
        for condition in limits:
            limited = limited | condition
        t.store("kf.kept", None, ~limited)
