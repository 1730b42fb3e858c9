"""The unscented Kalman filter (Julier & Uhlmann 2004; van der Merwe 2004; Sarkka & Svensson 2023, 8.8).

predict: sigma points of (x, P), and of the noise inputs that do not enter linearly, through f: see `propagation`.
update: see `update`; a linear h needs no points, and the update is then that of the ekf.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import KF, Block
from kfgen.filters.covariance.base import Form, Solving
from kfgen.filters.covariance.kernels.function import Kernels
from kfgen.filters.covariance.kernels.updates import absorb_one
from kfgen.filters.kinds.ekf import Ekf
from kfgen.filters.kinds.work import Learnt, Update
from kfgen.filters.sigma import cloud
from kfgen.filters.sigma.carried import by_process, by_sensor, images_of_process
from kfgen.filters.sigma.drawing import FROM, Drawing
from kfgen.filters.sigma.points import point_set
from kfgen.filters.sigma.propagation import Propagation
from kfgen.filters.sigma.seeing import Seeing
from kfgen.filters.sigma.update import whole_vector
from kfgen.filters.steps import process
from kfgen.filters.steps.phases import Phases
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.sensor import Linearised
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.scalars import Scalar


class Ukf(Ekf):
    """Emits a ukf that takes the whole vector of a sensor at once."""

    title = "Unscented Kalman filter"
    update_title = "update by the whole vector"

    def __init__(self, model: Model, form: Form[Any], scalar: Scalar) -> None:
        options = model.options.points
        assert options is not None
        self.points = options
        self.n = len(model.errors)
        self.keeps = not options.redraw
        self.own = options.kind == "custom"
        self.carried = () if self.own else by_process(model)
        self.set = point_set(options, self.n + len(self.carried))
        super().__init__(model, form, scalar)
        many = self.n >= FROM and model.spec.code.unroll != "full"
        self.loops = form.indexed or (many and not self.own and self.set.extra >= 0)
        self.drawing = Drawing(form, 8 * self.n * scalar.epsilon, self.loops)
        self.seeing = {sensor.name: self._seeing(sensor) for sensor in model.sensors}
        self.simple = self._is_simple()

    def _seeing(self, sensor: SensorModel) -> Seeing:
        carried = () if self.own or self.keeps else by_sensor(self.model, sensor)
        points = point_set(self.points, self.n + len(carried))
        return Seeing(self.model, sensor, points, carried, self.drawing, self.set if self.keeps else None)

    def _is_simple(self) -> bool:
        """Whether f is linear, so that F P F^T is what points would give."""
        model = self.model
        plain = not self.keeps and not self.carried and self.set.exact and not model.options.rejects
        if not plain or any(b is not None for b in model.bounds):
            return False
        if any(not part.flat for _, _, part in images_of_process(model).singles):
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
        options = [key for key in ("robust", "adaptive", "adapt_R") if getattr(chosen, key) is not None]
        text = f"{self.title}, {self.points.kind} points, {self.form.title} covariance, {self.update_title}"
        return text + "".join(f", {key}" for key in options)

    def private_functions(self, taken: frozenset[str]) -> list[Function]:
        made: list[Function] = []
        if not self.simple:
            if self.model.rotations:
                f = cloud.turning_dynamics(self.model, images_of_process(self.model), self.carried, taken)
            else:
                f = cloud.dynamics(self.model, self.carried, taken)
            made.append(f.function)
            absorb = None
            if self.loops and self.form.factored:
                absorb = absorb_one(Kernels(self.scalar.smallest, taken), self.n)
                made.append(absorb)
            self.propagation = Propagation(
                self.model, self.form, self.scalar, self.set, self.carried, self.drawing, f, absorb
            )
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

    @property
    def indexed(self) -> bool:
        return self.form.indexed if self.simple else self.loops

    def predicting(self, t: Trace, step: Step) -> Phases:
        """Points through f; x <- their mean, P <- their spread + Q + G Qw G^T of the noises that they do not carry."""
        if self.simple:
            yield from super().predicting(t, step)
        else:
            yield from self.propagation.predicting(self, t, step)

    # update ------------------------------------------------------------------------------------------

    def updating(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> Phases:
        if self.by_component(sensor):
            yield from super().updating(t, sensor, used)
        else:
            yield from whole_vector(self, self.seeing[sensor.name], t, sensor, used)

    def by_component(self, sensor: SensorModel) -> bool:
        """Whether components are taken one after another: as well as all at once where h is linear, but for options
        that judge the whole vector."""
        several = sensor.dimension > 1 and self.model.options.innovation_floor is not None
        return self.seeing[sensor.name].linear and not (self.model.spec.filter.adaptive is not None or several)

    def skipped(self, sensor: SensorModel) -> tuple[str, ...]:
        return self.seeing[sensor.name].carried

    def store_update(self, u: Update, x: list[Value], P: Any, learnt: Learnt) -> None:
        super().store_update(u, x, P, learnt)
        if self.keeps:
            u.t.store("kf.kept", None, u.t.wrapped(u.t.pool.boolean(False)))

    def residual_after(self, u: Update, x: list[Value], P: Any) -> Vector:
        seeing = self.seeing[u.sensor.name]
        if seeing.linear:
            return super().residual_after(u, x, P)
        return seeing.residual(u, x, P)


class SequentialUkf(Ukf):
    """Emits a ukf that takes the components one after another: H = Pxz^T P^-1."""

    update_title = "sequential update"

    def __init__(self, model: Model, form: Solving[Any], scalar: Scalar) -> None:
        super().__init__(model, form, scalar)
        self.solving = form

    def by_component(self, sensor: SensorModel) -> bool:
        return True

    def linearise(self, u: Update) -> Linearised:
        seeing = self.seeing[u.sensor.name]
        if seeing.linear:
            return super().linearise(u)
        linear, self._spread = seeing.regression(u, self.solving)
        return linear

    def spread(self, u: Update, linear: Linearised) -> Symmetric:
        return super().spread(u, linear) if self.seeing[u.sensor.name].linear else self._spread


FILTERS = {"ukf": Ukf, "sequential": SequentialUkf}
