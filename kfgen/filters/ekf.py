"""The Kalman filter and the extended Kalman filter (Bar-Shalom, Li & Kirubarajan 2001, ch. 5 and 10).

predict: F, G at the prior x; x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T.
update: see `sequence`. The filters that linearise otherwise are subclasses: iekf, ekf2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from kfgen.filters import guards, process
from kfgen.filters.adapt import AdaptedQ, AdaptedR
from kfgen.filters.base import DT, INPUTS, KF, MASK, Block, FilterCode, sensor_argument
from kfgen.filters.covariance import CovarianceCode, get_matrix
from kfgen.filters.gate import gate
from kfgen.filters.layout import Covariance, Layout
from kfgen.filters.linalg import Rows, Vector, plus
from kfgen.filters.linalg import dot as inner_product
from kfgen.filters.noise import Additive, Given
from kfgen.filters.numbers import is_positive, require_nonnegative
from kfgen.filters.process import Advance, Prior, Step
from kfgen.filters.sensor import Innovation, Linearised, SensorCode, decorrelated, masked, needs_inputs, total
from kfgen.filters.sequence import Sequence, Updated, departs
from kfgen.filters.state import StateCode, counts_gated
from kfgen.filters.symmetric import Symmetric
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.scalars import Scalar

# Measured with gcc 12 on a Cortex-M4F: its schedulers lengthen live ranges, and what no longer fits the registers
# costs two instructions each time.
LONG_FUNCTIONS = (
    "Recommended with gcc, for these long functions without branches:",
    "  -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers",
)


@dataclass
class Update:
    """What an update of one sensor works with. used: whether each component counts, where a mask tells."""

    t: Trace
    sensor: SensorModel
    code: SensorCode
    x: list[Value]  # in the spec's order
    layout: Layout
    used: list[Value] | None
    adapted: AdaptedR | None
    tested: list[Value] = field(default_factory=list)  # what else has to be finite

    @cached_property
    def P(self) -> Covariance:
        """As it stands in the struct, read when it is first needed."""
        return self.layout.load(self.t)


class Ekf:
    """Emits a kf or an ekf over any layout."""

    title = "Extended Kalman filter"
    derivatives = 1  # the highest that the model is asked for

    def __init__(self, model: Model, layout: Layout, scalar: Scalar) -> None:
        self.model = model
        self.layout = layout
        self.order = order = layout.order
        self.scalar = scalar
        self.names = [model.states[i] for i in order]
        options = model.options
        self.Q = None if options.adapt_Q is None else AdaptedQ(model, order, layout.factored, scalar.epsilon)
        extra = [] if self.Q is None else [self.Q.kept.block()]
        for sensor in model.sensors:
            adapted = self.adapted_R(sensor)
            extra += [] if adapted is None else adapted.blocks()
        extra += self.extra_blocks()
        self.covariance = CovarianceCode(model, layout, scalar.epsilon, self.outdated)
        self.state = StateCode(model, self.covariance.blocks(), tuple(extra), self.outdated)

    def code(self, taken: frozenset[str]) -> FilterCode:
        """The complete filter. taken: names that locals must not have."""
        model = self.model
        functions = [self.state.init(taken), *self.private_functions(), self.predict(taken)]
        for sensor in model.sensors:
            functions.append(self.update(sensor, taken))
            if sensor.spec.partial:
                functions.append(self.update(sensor, taken, partial=True))
        functions += [self.state.set_state(taken), *self.covariance.functions(taken)]
        for sensor in model.sensors:
            adapted = self.adapted_R(sensor)
            if adapted is not None:
                doc = f"The covariance of {sensor.name} as it has been adapted."
                name = f"R_{sensor.name}"
                functions.append(
                    get_matrix(name, "R", adapted.m, adapted.kept.get, lambda t: lambda i: i, doc, taken)
                )
        if self.Q is not None:
            functions.append(self.covariance.get_noise(self.Q.kept, taken))
        functions += self.further_functions(taken)
        return FilterCode(
            model=model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(self.order) if self.layout.reorders else tuple(range(len(self.order))),
            description=self.description(),
            notes=LONG_FUNCTIONS if len(self.order) >= 8 else (),
            constants=self.covariance.constants(),
            remarks=self.remarks(),
        )

    # what subclasses add

    @property
    def outdated(self) -> str:
        """A field that says whether something kept belongs to the present state; none: empty."""
        return ""

    def extra_blocks(self) -> list[Block]:
        return []

    def private_functions(self) -> list[Function]:
        return []

    def further_functions(self, taken: frozenset[str]) -> list[Function]:
        return []

    def skipped(self, sensor: SensorModel) -> tuple[str, ...]:
        """Noise inputs of a sensor that do not enter as M Re M^T."""
        return ()

    def remarks(self) -> tuple[str, ...]:
        return ()

    def description(self) -> str:
        spec = self.model.spec.filter
        title = "Kalman filter" if spec.type == "kf" else self.title
        form = "" if spec.update is None else f", {spec.update} update"
        options = [key for key in ("robust", "adaptive", "adapt_R", "adapt_Q") if getattr(spec, key) is not None]
        return f"{title}, {self.layout.title} covariance{form}" + "".join(f", {key}" for key in options)

    def adapted_R(self, sensor: SensorModel) -> AdaptedR | None:
        if self.model.options.adapt_R is None:
            return None
        return AdaptedR(self.model, sensor, self.layout.factored, self.scalar.epsilon)

    # predict -----------------------------------------------------------------------------------------

    def predict(self, taken: frozenset[str]) -> Function:
        """x <- f(x, u, 0), P <- F P F^T + Q + G Qw G^T."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments: list[Argument] = [KF]
        if model.inputs:
            arguments.append(INPUTS)
            t.section("arguments")
            guards.inputs(t, model.inputs)
        if model.dt is None and model.spec.dt is not None:
            arguments.append(DT)
        step = process.step_length(t, model)
        prior = process.given(t, model, step)
        t.section("model")
        result = self.advance(t, prior, step)
        order = self.order
        F = [[result.F[i][j] for j in order] for i in order]
        noise = [([w[i] for i in order], d) for w, d in result.noise]
        for row_name, row in zip(self.names, F, strict=True):
            for name, value in zip(self.names, row, strict=True):
                t.name(value, f"f_{row_name}_{name}")
        P = self.layout.predict(t, self.layout.load(t), F, self.additive(t, result), noise)
        x = [t.name(value, f"{name}_next") for value, name in zip(result.x, model.states, strict=True)]
        evidence = self.unconfined(x) + self.layout.evidence(P, after_predict=True)
        P = self.limited(t, P)
        x = self.state.confined(t, x)
        moved = {i for i, (value, before) in enumerate(zip(x, prior.x, strict=True)) if value.node is not before.node}
        t.section("guards")
        values = [v for rows in (F, result.Q) for row in rows for v in row]
        guards.doubts(t, [*result.x, *values, *(d for _, d in noise)])
        guards.finite(t, [x[i] for i in sorted(moved)] + evidence)
        self.store(t, x, moved, P, after_predict=True)
        process.store_time(t, model, step)
        length = "a step of dt" if model.dt is None else f"one step of {float(model.dt):.6g} s"
        if model.spec.dt is None:
            length = "one step"
        return Function(
            "predict", arguments, schedule(t, taken | {a.name for a in arguments}), f"Advance the estimate by {length}."
        )

    def advance(self, t: Trace, prior: Prior, step: Step) -> Advance:
        """The model's step from the prior, in the spec's order."""
        n = len(self.order)
        nothing = None if self.Q is None else [[t.zero] * n for _ in range(n)]
        return process.advance(t, self.model, prior, step, nothing, self.derivatives)

    def additive(self, t: Trace, result: Advance) -> Additive:
        """Q in the inner order."""
        Q = [[result.Q[i][j] for j in self.order] for i in self.order]
        return Given(Q) if self.Q is None else self.Q.additive(t, Q)

    # update ------------------------------------------------------------------------------------------

    def update(self, sensor: SensorModel, taken: frozenset[str], partial: bool = False) -> Function:
        """The update with the whole vector z of a sensor, or with the components that a mask selects."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments, used = self.opening(t, sensor, partial)
        t.section("innovation")
        code = SensorCode(t, model, sensor, self.order, self.derivatives, self.skipped(sensor))
        u = Update(t, sensor, code, code.prior(), self.layout, used, self.adapted_R(sensor))
        linear = self.linearise(u)
        innovation = self.innovation(u, linear)
        result = self.sequence(u, innovation, plain=True)
        final = self.final(u, innovation, result)
        x = self.moved(u, final.moved)
        inflates = self.model.options.inflation is not None and not self.layout.factored
        evidence = self.unconfined(x) + self.layout.evidence(final.P, after_predict=inflates)
        P = self.limited(t, final.P)
        x = self.state.confined(t, x)
        t.section("guards")
        if final is result and sensor.gate is None:
            guards.doubts(t, [*self._model_values(innovation), *u.tested])
            # nis shows whether z is finite, but for components that may have been skipped
            skippable = [v for v, r in zip(innovation.y, innovation.variances, strict=True) if not is_positive(r)]
            guards.finite(t, [*skippable, *x, result.nis, *evidence, *u.tested])
            guards.positive(t, result.failures)
        elif final is result:
            self.judged(u, innovation, result)
            guards.finite(t, [result.nis, *x, *evidence])
        else:
            guards.doubts(t, x)
            guards.finite(t, [result.nis, *x, *final.s, *evidence])
            guards.positive(t, final.failures)
        self.store_update(u, x, P, result, final)
        suffix, what = ("_masked", "the chosen components of a measurement") if partial else ("", "a measurement")
        return Function(
            f"update_{sensor.name}{suffix}", arguments, schedule(t, taken | {a.name for a in arguments}),
            f"Take {what} of {sensor.name} into account.",
        )  # fmt: skip

    def opening(self, t: Trace, sensor: SensorModel, partial: bool) -> tuple[list[Argument], list[Value] | None]:
        """The arguments of an update, tested, and whether each component counts where a mask tells."""
        arguments: list[Argument] = [KF, sensor_argument(sensor.name)]
        used: list[Value] | None = None
        if partial:
            used = [t.bit("mask", i) for i in range(len(sensor.h))]
            some = used[0]
            for bit in used[1:]:
                some = some | bit
            t.guard(~some, "OK")
        if needs_inputs(self.model, sensor):
            arguments.append(INPUTS)
            guards.inputs(t, self.model.inputs)
        if partial:
            arguments.append(MASK)
        self.state.initialize(t, sensor, used)
        return arguments, used

    def linearise(self, u: Update) -> Linearised:
        """h, H, R of the sensor at the prior."""
        return u.code.linearise(u.x)

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
            if linear.computed and any(r.constant is None for row in linear.R for r in row):
                Given(own).factors()  # what was added might hide that R is no covariance
        innovation = decorrelated(u.t, linear, R, u.used, smallest)
        for r in innovation.variances:
            require_nonnegative(r, "a measurement variance is negative")
        return innovation

    def spread(self, u: Update, linear: Linearised) -> Symmetric:
        """H P H^T."""
        H, dense = linear.H, self.layout.entries(u.P)
        return Symmetric(len(H), lambda i, j: inner_product(H[i], dense.times(H[j])))

    def final(self, u: Update, innovation: Innovation, plain: Updated) -> Updated:
        """The update that is made of the one that the gate judges."""
        if departs(self.model):
            self.judged(u, innovation, plain)
        return self.made(u, innovation, plain)

    def made(self, u: Update, innovation: Innovation, plain: Updated) -> Updated:
        """The update with all options."""
        if not departs(self.model):
            return plain
        return self.sequence(u, innovation, plain=False)

    def sequence(self, u: Update, innovation: Innovation, plain: bool) -> Updated:
        """The components one by one. plain: the textbook's update."""
        names = [c.name for c in u.sensor.spec.components]
        return Sequence(u.t, self.model, self.layout, names, plain, self.scalar.epsilon).run(u.P, innovation)

    def judged(self, u: Update, innovation: Innovation, plain: Updated) -> None:
        """Guards and gate over the textbook's update. A far outlier may overflow nis and is gated all the same."""
        t = u.t
        t.section("guards")
        guards.doubts(t, [*self._model_values(innovation), *u.tested])
        guards.finite(t, [*innovation.y, *plain.s, *u.tested])
        guards.positive(t, plain.failures)
        gate(t, self.model, u.sensor, plain.nis, u.used)

    def store_update(self, u: Update, x: list[Value], P: Covariance, judged: Updated, final: Updated) -> None:
        t, sensor = u.t, u.sensor
        after: Vector = []
        Q: tuple[Symmetric, tuple[Rows, Vector] | None] | None = None
        if u.adapted is not None:
            t.section("R: the residual that is left")
            after = self.residual_after(u, x, P)
            if u.used is not None:
                after = [t.select(bit, e, 0) for bit, e in zip(u.used, after, strict=True)]
            guards.finite(t, after)
        if self.Q is not None:
            t.section("Q: what the state has moved")
            Q = self.Q.next(t, final.steps)
            guards.finite(t, [t.value(Q[0][i, i]) for i in range(len(x))])
        self.store(t, x, set(range(len(x))), P, after_predict=False)
        if u.adapted is not None:
            u.adapted.store(t, after, u.used)
        if self.Q is not None and Q is not None:
            self.Q.kept.store(t, *Q)
        if counts_gated(self.model, sensor):
            t.store(f"kf.gate_count_{sensor.name}", None, t.wrapped(t.pool.integer(0)))
        t.store("kf.nis", None, judged.nis)
        if self.model.spec.code.log_likelihood:
            t.store("kf.log_likelihood", None, final.log_likelihood)

    def residual_after(self, u: Update, x: list[Value], P: Covariance) -> Vector:
        """z - h at the new x."""
        return u.code.residual(x)

    # ends --------------------------------------------------------------------------------------------

    def _model_values(self, innovation: Innovation) -> list[Value]:
        values = [v for row in innovation.rows for v in row if isinstance(v, Value)]
        return [*innovation.y, *innovation.variances, *values]

    def moved(self, u: Update, moved: Vector) -> list[Value]:
        """x after the update, in the spec's order, before bounds and wrapping."""
        t = u.t
        x = [t.zero] * len(moved)
        for place, m in zip(self.order, moved, strict=True):
            x[place] = t.name(t.value(plus(u.x[place], m)), f"{self.model.states[place]}_next")
        return x

    def limited(self, t: Trace, P: Covariance) -> Covariance:
        """variance_floor and variance_ceiling."""
        floors = [self.model.floors[i] for i in self.order]
        ceilings = [self.model.ceilings[i] for i in self.order]
        if not any(v is not None for v in (*floors, *ceilings)):
            return P
        t.section("limits of the variances")
        return self.layout.limit(t, P, floors, ceilings)

    def unconfined(self, x: list[Value]) -> list[Value]:
        """States before their bounds, which would hide what is infinite."""
        return [v for v, bounds in zip(x, self.model.bounds, strict=True) if bounds is not None]

    def store(self, t: Trace, x: list[Value], moved: set[int], P: Covariance, after_predict: bool) -> None:
        t.section("store")
        for i in sorted(moved):
            t.store("kf.x", i, x[i])
        self.layout.store(t, P, self.names, after_predict)
