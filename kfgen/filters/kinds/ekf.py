"""The Kalman filter and the extended Kalman filter (Bar-Shalom, Li & Kirubarajan 2001, ch. 5 and 10).

predict: F, G at the prior x; x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T.
update: see `sequence`. The filters that linearise otherwise are subclasses: iekf, ekf2.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

from kfgen.filters.algebra.linalg import Rows, Vector, plus
from kfgen.filters.algebra.linalg import dot as inner_product
from kfgen.filters.algebra.numbers import is_positive, require_nonnegative
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import Block, FilterCode
from kfgen.filters.covariance.base import Covariance, Layout, Rolled
from kfgen.filters.covariance.looped import Displacement, kept_in_array
from kfgen.filters.covariance.looped import learnt as learn_in_loops
from kfgen.filters.covariance.noise import Additive, Given
from kfgen.filters.frame import guards
from kfgen.filters.frame.runs import put
from kfgen.filters.steps import process
from kfgen.filters.steps.adapt import AdaptedQ, AdaptedR
from kfgen.filters.steps.covariance import CovarianceCode, get_matrix
from kfgen.filters.steps.gate import gate, store_outcome
from kfgen.filters.steps.phases import Judged, Made, Phases, begin_predict, begin_update, predict_doc, update_name
from kfgen.filters.steps.process import Advance, Prior, Step
from kfgen.filters.steps.sensor import Innovation, Linearised, SensorCode, decorrelated, masked, total
from kfgen.filters.steps.sequence import Sequence, Updated, departs
from kfgen.filters.steps.state import StateCode
from kfgen.ir.footprint import crowded
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.scalars import Scalar

# Measured with gcc 12 on a Cortex-M4F: its schedulers lengthen live ranges, and what no longer fits the registers
# costs two instructions each time. `kfgen cost` shows the figures with these flags and without.
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


@dataclass
class Learnt:
    """What an update leaves for an adapted R (m,), and the next Q."""

    residual: Vector = field(default_factory=list)
    Q: tuple[Symmetric, tuple[Rows, Vector] | None] | None = None
    Q_in_loops: Callable[[], None] | None = None  # stores it


class Ekf:
    """Emits a kf or an ekf over any layout."""

    title = "Extended Kalman filter"
    derivatives = 1  # the highest that the model is asked for

    def __init__(self, model: Model, layout: Layout, scalar: Scalar) -> None:
        self.model = model
        self.layout = layout
        self.plain = layout  # for what a filter by sigma points does without them
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
        extra = [replace(block, entries=()) for block in extra] if layout.rolled else extra
        outdated = (self.outdated,) if self.outdated else ()
        self.covariance = CovarianceCode(model, layout, scalar.epsilon, self.outdated)
        self.state = StateCode(model, self.covariance.blocks(), tuple(extra), outdated)

    def code(self, taken: frozenset[str]) -> FilterCode:
        """The complete filter. taken: names that locals must not have."""
        model = self.model
        functions = [self.state.init(taken), *self.private_functions(taken), self.predict(taken)]
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
        names = {"predict", *(f"update_{sensor.name}" for sensor in model.sensors)}
        steps = [function for function in functions if function.name in names]
        long = len(self.order) >= 8 or (self.scalar.name == "float" and crowded(steps))
        return FilterCode(
            model=model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(self.order) if self.layout.reorders else tuple(range(len(self.order))),
            description=self.description(),
            notes=LONG_FUNCTIONS if long else (),
            constants=self.covariance.constants(),
            remarks=self.remarks(),
        )

    def own_blocks(self) -> tuple[Block, ...]:
        """The fields that are this filter's own where it is a mode of a bank."""
        x = next(block for block in self.state.blocks() if block.name == "x")
        return (x, *self.state.covariance, *self.state.extra)

    # what subclasses add

    @property
    def predicts_in_loops(self) -> bool:
        """Whether a prediction reads the covariance in loops."""
        return False

    @property
    def outdated(self) -> str:
        """A field that says whether something kept belongs to the present state; none: empty."""
        return ""

    def extra_blocks(self) -> list[Block]:
        return []

    def private_functions(self, taken: frozenset[str]) -> list[Function]:
        """What the steps call; made before them."""
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
        t = Trace(self.scalar.smallest)
        arguments, step = begin_predict(t, self.model)
        for _ in self.predicting(t, step):
            pass
        process.store_time(t, self.model, step)
        names = taken | {a.name for a in arguments}
        return Function("predict", arguments, schedule(t, names), predict_doc(self.model))

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
        x = [t.name(value, f"{name}_next") for value, name in zip(result.x, model.states, strict=True)]
        P0 = self.layout.load(t)
        if self.layout.rolled:
            x = kept_in_array(t, x, prior.x)
        P = self.layout.predict(t, P0, F, self.additive(t, result), noise)
        evidence = self.unconfined(x) + self.layout.evidence(P, after_predict=True)
        P = self.limited(t, P)
        x = self.state.confined(t, x)
        moved = {i for i, (value, before) in enumerate(zip(x, prior.x, strict=True)) if value.node is not before.node}
        t.section("guards")
        values = [v for rows in (F, result.Q) for row in rows for v in row]
        guards.doubts(t, [*result.x, *values, *(d for _, d in noise)])
        guards.finite(t, [x[i] for i in sorted(moved)] + evidence)
        yield Made(x, P)
        self.store(t, x, moved if t.in_place else set(range(len(x))), P, after_predict=True)

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
        arguments, used = begin_update(t, [model], [sensor], partial)
        self.state.initialize(t, sensor, used)
        for phase in self.updating(t, sensor, used):
            if isinstance(phase, Judged):
                gate(t, model, [sensor], [phase.nis], used)
            else:
                made = phase
        assert made.nis is not None
        assert made.log_likelihood is not None
        store_outcome(t, model, [sensor], made.nis, made.log_likelihood)
        name, doc = update_name(sensor, partial)
        return Function(name, arguments, schedule(t, taken | {a.name for a in arguments}), doc)

    def updating(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
        """The update of the estimate in the struct. used: whether each component counts, where a mask tells."""
        t.section("innovation")
        code = SensorCode(t, self.model, sensor, self.order, self.derivatives, self.skipped(sensor))
        u = Update(t, sensor, code, code.prior(), self.layout, used, self.adapted_R(sensor))
        linear = self.linearise(u)
        innovation = self.innovation(u, linear)
        result = self.sequence(u, innovation, plain=True)
        final = yield from self.final(u, innovation, result)
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
            yield from self.judged(u, innovation, result)
            guards.finite(t, [result.nis, *x, *evidence])
        else:
            guards.doubts(t, x)
            guards.finite(t, [result.nis, *x, *final.s, *evidence])
            guards.positive(t, final.failures)
        kept = self.prepared(u, x, P, final)
        yield Made(x, P, result.nis, final.log_likelihood)
        self.store_update(u, x, P, kept)

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

    def final(self, u: Update, innovation: Innovation, plain: Updated) -> Generator[Judged | Made, None, Updated]:
        """The update that is made of the one that the gate judges."""
        if departs(self.model):
            yield from self.judged(u, innovation, plain)
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

    def judged(self, u: Update, innovation: Innovation, plain: Updated) -> Phases:
        """Guards, and then the gate, over the textbook's update. A far outlier may overflow nis and is gated all the
        same."""
        t = u.t
        t.section("guards")
        guards.doubts(t, [*self._model_values(innovation), *u.tested])
        guards.finite(t, [*innovation.y, *plain.s, *u.tested])
        guards.positive(t, plain.failures)
        yield Judged(plain.nis)

    def prepared(self, u: Update, x: list[Value], P: Covariance, final: Updated) -> Learnt:
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
            if isinstance(final.moved, Displacement):
                learnt.Q_in_loops = learn_in_loops(t, cast(Rolled, self.layout), self.Q, final.moved)
            else:
                learnt.Q = self.Q.next(t, final.steps)
                guards.finite(t, [t.value(learnt.Q[0][i, i]) for i in range(len(x))])
        return learnt

    def store_update(self, u: Update, x: list[Value], P: Covariance, learnt: Learnt) -> None:
        if learnt.Q_in_loops is not None and not self.layout.factored:  # while the gains are what they were
            learnt.Q_in_loops()
        self.store(u.t, x, set(range(len(x))), P, after_predict=False)
        if learnt.Q_in_loops is not None and self.layout.factored:  # when the arrays of P are free
            learnt.Q_in_loops()
        if u.adapted is not None:
            u.adapted.store(u.t, learnt.residual, u.used)
        if self.Q is not None and learnt.Q is not None:
            self.Q.kept.store(u.t, *learnt.Q)

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
        if isinstance(moved, Displacement):
            return moved.state(self.covariance.place(t))
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
        put(t, lambda i, value: t.store("kf.x", i, value), {i: x[i] for i in sorted(moved)}, local=True)
        self.layout.store(t, P, self.names, after_predict)
