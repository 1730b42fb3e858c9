"""The measurement model of one sensor: its prediction, Jacobian, noise covariance and innovation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Number, Vector, jacobian, value_of, values, variables
from kfgen.reference.evaluate import Closure, renamed
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import PREDICTED, Context, Model, Z, wrap
from kfgen.reference.reading import in_use
from kfgen.reference.status import Status, StepError
from kfgen.spec.tree import Expression, names
from kfgen.spec.types import Sensor

_HIDDEN = {"z": Z, "h": PREDICTED}


@dataclass(frozen=True)
class Reading:
    """A measurement to be processed: z (m), of which the components `used` count."""

    sensor: SensorModel
    z: Vector
    used: tuple[int, ...]
    context: Context


@dataclass(frozen=True)
class Linearisation:
    """Of the k components in use: h (k) the prediction, H (k, n) its Jacobian, R (k, k) the covariance of the
    measurement noise, that of the noise inputs included; inputs (k, k): what those alone bring."""

    h: Vector
    H: Matrix
    R: Matrix
    inputs: Matrix


class SensorModel:
    """One sensor of a spec.

    Attributes: name; components: their names; m: how many; own: the names of its inputs; takes_inputs: whether h, R or
    what they use contain inputs, so that an update needs u; partial: whether an update may be masked; bent: for each
    component, whether its differences are other than z - h.
    """

    def __init__(self, model: Model, sensor: Sensor) -> None:
        self.model = model
        self.spec = sensor
        self.name = sensor.name
        self.components = tuple(component.name for component in sensor.components)
        self.m = len(self.components)
        self.own = tuple(entry.name for entry in sensor.inputs)
        self.partial = sensor.partial
        self._h = [model.scope.compile(component.h) for component in sensor.components]
        self._periods = [
            None if component.period is None else model.number(component.period) for component in sensor.components
        ]
        residuals = [None if c.residual is None else renamed(c.residual.tree, _HIDDEN) for c in sensor.components]
        self._residuals: list[Closure | None] = [
            None if residual is None else model.scope.compile(residual) for residual in residuals
        ]
        own = {c.name: c.variance for c in sensor.components if c.variance is not None}
        self._R = model.covariance(own if sensor.R is None else sensor.R, self.components)
        self.turns = tuple(c.residual is not None or c.period is not None for c in sensor.components)
        self._noises = [noise.name for noise in sensor.noise]
        predicted = [component.h for component in sensor.components]
        self._Re = model.noise_covariance(in_use(model.spec, sensor.noise, predicted), sensor.noise_covariance)
        self.takes_inputs = bool(_reach(model, sensor) & set(model.inputs))

    def predict(self, x: Sequence[Number], e: Sequence[Number], context: Context, used: Sequence[int]) -> list[Number]:
        """h of the components in use at the state x (n) and the noise inputs e."""
        environment = self.model.environment(context, x, dict(zip(self._noises, e, strict=True)), self.own)
        return [self._h[i](environment) for i in used]

    def linearise(self, x: Vector, reading: Reading, learnt: bool = False) -> Linearisation:
        """h, H and R + M Re M^T at x (n), M = dh/de at e = 0; learnt: without R. Raises StepError NOT_FINITE.

        Whether R is a covariance is for the update to judge, after all that could be not finite.
        """
        n, k = self.model.n, len(self._noises)
        joint = variables([*x, *np.zeros(k)])
        predicted = self.predict(joint[:n], joint[n:], reading.context, reading.used)
        derivatives = jacobian(predicted, n + k)
        h, H, M = values(predicted), derivatives[:, :n], derivatives[:, n:]
        inputs = M @ self.input_covariance(x, reading.context) @ M.T
        R = symmetric(inputs if learnt else self.noise(x, reading.context, reading.used) + inputs)
        if not (np.isfinite(h).all() and np.isfinite(H).all() and np.isfinite(R).all()):
            raise StepError(Status.NOT_FINITE)
        return Linearisation(h, H, R, symmetric(inputs))

    def noise(self, x: Vector, context: Context, used: Sequence[int] | None = None) -> Matrix:
        """R (k, k) of the components in use at x (n), without the noise inputs."""
        return self._R(self.model.environment(context, x, own=self.own), used)

    def input_covariance(self, x: Vector, context: Context) -> Matrix:
        """The covariance of the sensor's noise inputs at x (n)."""
        return self._Re(self.model.environment(context, x, own=self.own))

    def jacobian(self, x: Vector, reading: Reading) -> Matrix:
        """H (k, n) of the components in use at x (n); may be NaN."""
        still = [0.0] * len(self._noises)
        return jacobian(self.predict(variables(x), still, reading.context, reading.used), self.model.n)

    def input_share(self, x: Vector, reading: Reading, inputs: Sequence[int]) -> Matrix:
        """M Re M^T (k, k) at x (n) of some of the noise inputs alone."""
        e: list[Number] = [0.0] * len(self._noises)
        for i, variable in zip(inputs, variables(np.zeros(len(inputs))), strict=True):
            e[i] = variable
        predicted = self.predict([float(v) for v in x], e, reading.context, reading.used)
        M = jacobian(predicted, len(inputs))
        return symmetric(M @ self.input_covariance(x, reading.context)[np.ix_(inputs, inputs)] @ M.T)

    def expand(self, x: Vector, reading: Reading) -> list[Number]:
        """h of the components in use as second-order Duals in the joint variables (x, noise inputs)."""
        joint = variables([*x, *np.zeros(len(self._noises))], order=2)
        return self.predict(joint[: self.model.n], joint[self.model.n :], reading.context, reading.used)

    def residual(self, x: Vector, reading: Reading) -> Vector:
        """z - h(x) of the components in use, as `innovation` has it. Raises StepError NOT_FINITE."""
        still = [0.0] * len(self._noises)
        predicted = self.predict([float(v) for v in x], still, reading.context, reading.used)
        return self.innovation(values(predicted), x, reading)

    def innovation(self, h: Vector, x: Vector, reading: Reading) -> Vector:
        """z - h of the components in use, as `difference` has it; h (k) is the prediction made at x (n)."""
        return self.difference(reading.z[list(reading.used)], h, x, reading)

    def difference(
        self, z: Vector, h: Vector, x: Vector, reading: Reading, wrapped: Sequence[int] | None = None
    ) -> Vector:
        """z - h (k) of the components in use, wrapped where periodic, or by the component's own residual.

        wrapped: the components that are, if not all. An own residual may use x (n) as h does. Raises StepError
        NOT_FINITE.
        """
        environment = self.model.environment(reading.context, x, own=self.own)
        y = np.zeros(len(reading.used))
        for k, i in enumerate(reading.used):
            measured, predicted = float(z[k]), float(h[k])
            residual, period = self._residuals[i], self._periods[i]
            if residual is not None:
                environment[self.model.scope.slots[Z]] = measured
                environment[self.model.scope.slots[PREDICTED]] = predicted
                y[k] = value_of(residual(environment))
            elif period is not None and (wrapped is None or i in wrapped):
                y[k] = wrap(measured - predicted, period)
            else:
                y[k] = measured - predicted
        if not np.isfinite(y).all():
            raise StepError(Status.NOT_FINITE)
        return y


def _reach(model: Model, sensor: Sensor) -> set[str]:
    """Every name that the sensor's formulas use, through definitions too."""
    formulas: list[Expression | None] = []
    for component in sensor.components:
        formulas += [component.h, component.variance]
    formulas += [] if sensor.gate is None else [sensor.gate.threshold]
    formulas += [noise.variance for noise in sensor.noise]
    for matrix in (sensor.R, sensor.noise_covariance):
        formulas += [entry for row in matrix or () for entry in row]
    definitions = {definition.name: definition.value for definition in model.spec.let}
    found: set[str] = set()
    trees = [formula.tree for formula in formulas if formula is not None]
    trees += [renamed(c.residual.tree, _HIDDEN) for c in sensor.components if c.residual is not None]
    pending = [name for tree in trees for name in names(tree)]
    while pending:
        name = pending.pop()
        if name not in found:
            found.add(name)
            pending += names(definitions[name].tree) if name in definitions else ()
    return found
