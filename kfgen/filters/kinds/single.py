"""What every filter of one model is made of: its fields, its functions, and the options that all kinds share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, Self

from kfgen.filters.base import Block, FilterCode
from kfgen.filters.covariance.base import Form
from kfgen.filters.frame import guards
from kfgen.filters.frame.runs import put
from kfgen.filters.steps import process
from kfgen.filters.steps.adapt import AdaptedQ, AdaptedR
from kfgen.filters.steps.compensation import Compensation
from kfgen.filters.steps.covariance import CovarianceCode, get_matrix
from kfgen.filters.steps.gate import gate, store_outcome
from kfgen.filters.steps.phases import Judged, Phases, begin_predict, begin_update, predict_doc, update_name
from kfgen.filters.steps.process import Step
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


class SingleFilter(ABC):
    """A filter of one model over any form of the covariance; subclasses make its steps."""

    title: str

    def __init__(self, model: Model, form: Form[Any], scalar: Scalar) -> None:
        self.model = model
        self.form = form
        self.order = order = form.order
        self.scalar = scalar
        self.names = [model.states[i] for i in order]
        options = model.options
        self.Q = None if options.adapt_Q is None else AdaptedQ(model, order, form.factored, scalar.epsilon)
        extra = [] if self.Q is None else [self.Q.kept.block()]
        for sensor in model.sensors:
            adapted = self.adapted_R(sensor)
            extra += [] if adapted is None else adapted.blocks()
        self.compensation = Compensation(model)
        extra = [*self.compensation.blocks(), *form.named([*extra, *self.extra_blocks()])]
        outdated = (self.outdated,) if self.outdated else ()
        self.covariance = CovarianceCode(model, form, scalar.epsilon, self.outdated)
        self.state = StateCode(model, self.covariance.blocks(), tuple(extra), outdated)

    # the steps, in phases

    @abstractmethod
    def predicting(self, t: Trace, step: Step) -> Phases:
        """The step from the estimate in the struct."""

    @abstractmethod
    def updating(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
        """The update of the estimate in the struct. used: whether each component counts, where a mask tells."""

    # the whole

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
            order=tuple(self.order) if self.form.reorders else tuple(range(len(self.order))),
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
    def indexed(self) -> bool:
        """Whether a prediction reads the covariance by counters: see Form."""
        return self.form.indexed

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
        return f"{title}, {self.form.title} covariance{form}" + "".join(f", {key}" for key in options)

    def of(self, sensor: SensorModel) -> Self:
        """The filter with the options of one sensor, for its updates."""
        if sensor.options is None:
            return self
        other = copy(self)
        other.model = self.model.of(sensor)
        return other

    def adapted_R(self, sensor: SensorModel) -> AdaptedR | None:
        model = self.model.of(sensor)
        if model.options.adapt_R is None:
            return None
        return AdaptedR(model, sensor, self.form.factored, self.scalar.epsilon)

    # functions

    def predict(self, taken: frozenset[str]) -> Function:
        """x <- f(x, u, 0), P <- F P F^T + Q + G Qw G^T."""
        t = Trace(self.scalar.smallest)
        arguments, step = begin_predict(t, self.model)
        for _ in self.predicting(t, step):
            pass
        process.store_time(t, self.model, step)
        guards.settled(t, self.model)
        names = taken | {a.name for a in arguments}
        return Function("predict", arguments, schedule(t, names), predict_doc(self.model))

    def update(self, sensor: SensorModel, taken: frozenset[str], partial: bool = False) -> Function:
        """The update with the whole vector z of a sensor, or with the components that a mask selects."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments, used = begin_update(t, [model.of(sensor)], [sensor], partial)
        self.state.initialize(t, sensor, used)
        for phase in self.of(sensor).updating(t, sensor, used):
            if isinstance(phase, Judged):
                gate(t, model, [sensor], [phase.nis], used)
            else:
                made = phase
        assert made.nis is not None
        assert made.log_likelihood is not None
        store_outcome(t, model, [sensor], [made.nis], made.log_likelihood)
        guards.settled(t, model)
        name, doc = update_name(sensor, partial)
        return Function(name, arguments, schedule(t, taken | {a.name for a in arguments}), doc)

    # ends

    def limited(self, t: Trace, P: Any) -> Any:
        """variance_floor and variance_ceiling."""
        floors = [self.model.floors[i] for i in self.order]
        ceilings = [self.model.ceilings[i] for i in self.order]
        if not any(v is not None for v in (*floors, *ceilings)):
            return P
        t.section("limits of the variances")
        return self.form.limit(t, P, floors, ceilings, self.scalar.epsilon)

    def unconfined(self, x: list[Value]) -> list[Value]:
        """States before their bounds, which would hide what is infinite."""
        return [v for v, bounds in zip(x, self.model.bounds, strict=True) if bounds is not None]

    def store(self, t: Trace, x: list[Value], moved: set[int], P: Any, after_predict: bool) -> None:
        t.section("store")
        put(t, lambda i, value: t.store("kf.x", i, value), {i: x[i] for i in sorted(moved)}, local=True)
        self.form.store(t, P, self.names, after_predict)
