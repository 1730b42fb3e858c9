"""The Kalman filter and the extended Kalman filter (Bar-Shalom, Li & Kirubarajan 2001, ch. 5 and 10).

predict: F, G at the prior x; x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T.
update: see `sequence`. The filters that linearise otherwise are subclasses: iekf, ekf2.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from functools import reduce
from operator import or_
from typing import Any

from kfgen.filters.algebra.linalg import Vector, dot, plus
from kfgen.filters.algebra.numbers import assume_positive, is_positive, positive_within, require_nonnegative
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.noise import Additive, Given
from kfgen.filters.covariance.parts import Motion
from kfgen.filters.frame import guards
from kfgen.filters.kinds.single import SingleFilter
from kfgen.filters.kinds.work import Learnt, Update
from kfgen.filters.steps import process
from kfgen.filters.steps.aligned import aligned
from kfgen.filters.steps.phases import Judged, Made, Phases
from kfgen.filters.steps.process import Advance, Prior, Step
from kfgen.filters.steps.resetting import moving
from kfgen.filters.steps.sensor import Innovation, Linearised, SensorCode, decorrelated, masked, total
from kfgen.filters.steps.sequence import Sequence, Updated, departs
from kfgen.geometry import Turn
from kfgen.ir.trace import Trace, Value
from kfgen.model.model import SensorModel

Final = Generator[Judged | Made, None, Updated[Any]]
"""Yields as Phases do, and returns the update that is made."""


class Ekf(SingleFilter):
    """Emits a kf or an ekf."""

    title = "Extended Kalman filter"
    derivatives = 1  # the highest that the model is asked for

    # predict -----------------------------------------------------------------------------------------

    def predicting(self, t: Trace, step: Step) -> Phases:
        """The step from the estimate in the struct."""
        model = self.model
        prior = process.given(t, model, step)
        t.section("model")
        result = self.advance(t, prior, step)
        order = self.order
        F = [[result.F[i][j] for j in order] for i in order]
        noise = [([w[i] for i in order], d) for w, d in result.noise]
        for row_name, row in zip(self.names, F, strict=True):
            for name, value in zip(self.names, row, strict=True):
                t.name(value, f"f_{row_name}_{name}")
        compensated, rests = self.compensation.moved(t, prior.x, result.steps)
        x = [compensated[i] if i in rests else t.name(value, f"{name}_next")
             for i, (value, name) in enumerate(zip(result.x, model.states, strict=True))]  # fmt: skip
        P0 = self.form.load(t)
        x = self.form.kept(t, x, prior.x)
        P = self.form.predict(t, P0, F, self.additive(t, result, step), noise)
        evidence = self.unconfined(x) + self.form.evidence(P, after_predict=True)
        P = self.limited(t, P)
        free, x = x, self.state.confined(t, x)
        moved = {i for i, (value, before) in enumerate(zip(x, prior.x, strict=True)) if value.node is not before.node}
        t.section("guards")
        values = [v for rows in (F, result.Q) for row in rows for v in row]
        values += [v for w, d in noise for v in (*w, d)]
        guards.doubts(t, [*result.x, *values])
        # loops hide how the evidence is made: of all columns of F and of the noise
        guards.finite(t, [x[i] for i in sorted(moved)] + evidence, [] if self.form.indexed else values)
        yield Made(x, P)
        self.store(t, x, moved if t.in_place else set(range(len(x))), P, after_predict=True)
        self.compensation.store(t, rests, free, x)
        if self.Q is not None:
            self.Q.store_step(t, step.dt)

    def advance(self, t: Trace, prior: Prior, step: Step) -> Advance:
        """The model's step from the prior, in the spec's order."""
        n = len(self.order)
        nothing = None if self.Q is None else [[t.zero] * n for _ in range(n)]
        return process.advance(t, self.model, prior, step, nothing, self.derivatives)

    def additive(self, t: Trace, result: Advance, step: Step) -> Additive:
        """Q in the inner order."""
        Q = [[result.Q[i][j] for j in self.order] for i in self.order]
        return Given(Q) if self.Q is None else self.Q.additive(t, Q, step.dt)

    # update ------------------------------------------------------------------------------------------

    def updating(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
        """The update of the estimate in the struct. used: whether each component counts, where a mask tells."""
        t.section("innovation")
        code = SensorCode(t, self.model, sensor, self.order, self.derivatives, self.skipped(sensor))
        code.counts = used
        u = Update(t, sensor, code, code.prior(), self.form, used, self.adapted_R(sensor))
        linear = self.compensation.corrected(t, self.linearise(u), self.order)
        innovation = self.innovation(u, linear)
        result = self.sequence(u, innovation, plain=True)
        final = yield from self.final(u, innovation, result)
        textbook = final is result
        x = self.moved(u, final.motion)
        if u.turns:
            final = replace(final, P=self.reset(u, final.P))
        inflates = self.model.options.inflation is not None and not self.form.factored
        evidence = self.unconfined(x) + self.form.evidence(final.P, after_predict=inflates)
        P = self.limited(t, final.P)
        u.free, x = x, self.state.confined(t, x)
        t.section("guards")
        if textbook and sensor.gate is None:
            guards.doubts(t, [*self._model_values(innovation), *u.tested])
            # nis shows whether z is finite, but for components that may have been skipped
            skippable = [v for v, r in zip(innovation.y, innovation.variances, strict=True) if not is_positive(r)]
            guards.finite(t, [*skippable, *x, result.nis, *evidence, *u.tested], self._entering(innovation, result))
            self._positive(u, result)
        elif textbook:
            yield from self.judged(u, innovation, result)
            guards.finite(t, [result.nis, *x, *evidence])
        else:
            guards.doubts(t, x)
            guards.finite(t, [result.nis, *x, *final.s, *evidence], [final.log_likelihood])
            self._positive(u, final)
        kept = self.prepared(u, x, P, final.motion)
        yield Made(x, P, result.nis, final.log_likelihood)
        self.store_update(u, x, P, kept)

    def linearise(self, u: Update) -> Linearised:
        """h, H, R of the sensor at the prior."""
        linear = u.code.linearise(u.x)
        straight = bool(self.model.rotations) and not self.form.indexed  # loops want rows that measure something
        return aligned(u.code, linear, u.x) if straight else linear

    def innovation(self, u: Update, linear: Linearised) -> Innovation:
        """Scalar measurements of a linearisation: R adapted, masked, decorrelated."""
        R = total(linear)
        smallest = None
        if u.adapted is not None:
            m = len(linear.H)
            adapted = u.adapted.next or u.adapted.adapted(u.t, self.spread(u, linear), u.used)
            R = [[u.t.value(plus(adapted[i, j], linear.added[i][j])) for j in range(m)] for i in range(m)]
        if u.adapted is not None or linear.computed:
            smallest = len(R) * self.scalar.epsilon
        if u.used is not None:
            own = masked(u.t, linear, linear.R, u.used)[1]
            linear, R = masked(u.t, linear, R, u.used)
            if u.adapted is None and linear.computed and any(r.constant is None for row in linear.R for r in row):
                Given(own).factors()  # what was added might hide that R is no covariance
        innovation = decorrelated(u.t, linear, R, u.used, smallest)
        for r in innovation.variances:
            require_nonnegative(r, "a measurement variance is negative")
            self.suppose(u.sensor, r)
        return innovation

    def suppose(self, sensor: SensorModel, r: Value) -> None:
        """Take a variance for positive that is not 0 within the declared ranges: 0 is then no case of its own."""
        if not self.scalar.uniform or is_positive(r):
            return
        if positive_within(r, process.declared_signs(self.model, sensor)):
            assume_positive(r)

    def spread(self, u: Update, linear: Linearised) -> Symmetric:
        """H P H^T."""
        H, dense = linear.H, self.form.entries(u.P)
        return Symmetric(len(H), lambda i, j: dot(H[i], dense.times(H[j])))

    def final(self, u: Update, innovation: Innovation, plain: Updated[Any]) -> Final:
        """The update that is made of the one that the gate judges."""
        if departs(self.model):
            yield from self.judged(u, innovation, plain)
        return self.made(u, innovation, plain)

    def made(self, u: Update, innovation: Innovation, plain: Updated[Any]) -> Updated[Any]:
        """The update with all options."""
        if not departs(self.model):
            return plain
        return self.sequence(u, innovation, plain=False)

    def sequence(self, u: Update, innovation: Innovation, plain: bool, P: Any = None) -> Updated[Any]:
        """The components one by one. plain: the textbook's update. P: in place of that of the struct."""
        sequence = Sequence(u.t, self.model, self.form, list(u.sensor.errors), plain, self.scalar.epsilon)
        return sequence.run(u.P if P is None else P, innovation)

    def judged(self, u: Update, innovation: Innovation, plain: Updated[Any]) -> Phases:
        """Guards, and then the gate, over the textbook's update. A far outlier may overflow nis and is gated all the
        same."""
        t = u.t
        t.section("guards")
        guards.doubts(t, [*self._model_values(innovation), *u.tested])
        guards.finite(t, [*innovation.y, *u.tested], self._entering(innovation, plain))
        self._positive(u, plain)
        yield Judged(plain.nis)

    def _positive(self, u: Update, result: Updated[Any]) -> None:
        """Guards of the innovation variances. Where rounding has made one negative no gain is any good: the measurement
        is left out, and P such that the next one can be taken."""
        t = u.t
        guards.positive(t, result.failures)
        if result.spoilt:
            with t.when(reduce(or_, result.spoilt), rare=True):
                u.form.loosen(t)
                t.leave()

    def prepared(self, u: Update, x: list[Value], P: Any, motion: Motion) -> Learnt:
        """What an update has to say of R and Q."""
        t = u.t
        learnt = Learnt()
        if u.adapted is not None:
            t.section("R: the residual that is left")
            learnt.residual = self.residual_after(u, x, P)
            if u.used is not None:
                learnt.residual = [t.select(bit, e, 0) for bit, e in zip(u.used, learnt.residual, strict=True)]
            guards.finite(t, learnt.residual)
        if self.Q is not None:
            t.section("Q: what the state has moved")
            learnt.Q = motion.learnt(self.Q.kept, self.Q.rate, self.Q.scale(t))
        return learnt

    def store_update(self, u: Update, x: list[Value], P: Any, learnt: Learnt) -> None:
        if learnt.Q is not None and learnt.Q.early:
            learnt.Q.store()
        self.store(u.t, x, set(range(len(x))), P, after_predict=False)
        self.compensation.store(u.t, u.rests, u.free, x)
        if u.adapted is not None:
            u.adapted.store(u.t, learnt.residual, u.used)
        if learnt.Q is not None and not learnt.Q.early:
            learnt.Q.store()

    def residual_after(self, u: Update, x: list[Value], P: Any) -> Vector:
        """z - h at the new x."""
        return u.code.residual(x)

    def _entering(self, innovation: Innovation, result: Updated[Any]) -> list[Value]:
        """What enters the estimate: innovation variances, and through them R and H."""
        if self.form.indexed:  # loops hide how nis and x are made of y and H
            return [*result.s, *innovation.variances]
        return [*result.s, *self._model_values(innovation)]

    def _model_values(self, innovation: Innovation) -> list[Value]:
        values = [v for row in innovation.rows for v in row if isinstance(v, Value)]
        return [*innovation.y, *innovation.variances, *values]

    def moved(self, u: Update, motion: Motion) -> list[Value]:
        """x after the update, in the spec's order, before bounds and wrapping."""
        if self.model.rotations:
            return self.retracted(u, motion)
        x = motion.state(u.x, self.model.states, self.covariance.place)
        dx = motion.entries() if self.compensation.states else []
        steps = {i: u.t.value(dx[self.order.index(i)]) for i in self.compensation.states}
        compensated, u.rests = self.compensation.moved(u.t, u.x, steps)
        return [compensated[i] if i in u.rests else value for i, value in enumerate(x)]

    def retracted(self, u: Update, motion: Motion) -> list[Value]:
        """x [+] d. The turns of the rotations are kept for the reset."""
        t, model = u.t, self.model
        d = self.by_error(t, motion)
        x = list(u.x)
        turns = []
        for r in model.rotations:
            by, first = d[r.first_error : r.first_error + 3], r.first_error
            if u.base is not None and u.apart is not None:
                x[r.first : r.first + 4] = u.base[r.first : r.first + 4]
                by = [a - b for a, b in zip(by, u.apart[first : first + 3], strict=True)]
            turns.append(Turn([t.name(a, f"d_{name}") for a, name in zip(by, r.errors, strict=True)]))
        u.turns = turns
        for i, j, _ in model.space.singles:
            x[i] = t.name(t.value(plus(x[i], d[j])), f"{model.states[i]}_next")
        for r, turn in zip(model.rotations, u.turns, strict=True):
            new = r.geometry.turned(x[r.first : r.first + 4], turn)
            x[r.first : r.first + 4] = [t.name(a, f"{part}_next") for a, part in zip(new, r.parts, strict=True)]
        steps = {i: d[k] for i in self.compensation.states if (k := model.space.errors_of[i]) is not None}
        compensated, u.rests = self.compensation.moved(t, u.x, steps)
        return [compensated[i] if i in u.rests else value for i, value in enumerate(x)]

    def by_error(self, t: Trace, motion: Motion) -> list[Value]:
        """By what an update moves, in the spec's order."""
        d = [t.zero] * len(self.order)
        for place, m in zip(self.order, motion.entries(), strict=True):
            d[place] = t.value(m)
        return d

    def nothing(self, t: Trace) -> Additive:
        """No noise."""
        return Given([[t.zero] * len(self.order) for _ in self.order])

    def reset(self, u: Update, P: Any) -> Any:
        """P of the errors as they are seen from the new attitudes: T P T^T."""
        turned = [(r, turn) for r, turn in zip(self.model.rotations, u.turns, strict=True) if r.reset]
        if not turned:
            return P
        u.t.section("reset: the errors as seen from the new attitude")
        return self.form.turned(u.t, P, moving(u.t, self.model, self.order, turned), self.nothing(u.t), [])


FILTERS = {"kf": Ekf, "ekf": Ekf}
