"""The measurement model of one sensor: its prediction, Jacobian, noise covariance and innovation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Number, Vector, jacobian, value_of, values
from kfgen.reference.dual import variables as numbers
from kfgen.reference.evaluate import Closure, renamed
from kfgen.reference.linalg import symmetric
from kfgen.reference.manifold import Manifold, at_zero
from kfgen.reference.model import PREDICTED, Context, Model, Z, wrap
from kfgen.reference.reading import in_use, variances
from kfgen.reference.status import Status, StepError
from kfgen.spec.tree import Expression, names
from kfgen.spec.types import Sensor

_HIDDEN = {"z": Z, "h": PREDICTED}


@dataclass(frozen=True)
class Reading:
    """A measurement to be processed: z (m), of which the numbers `used` count."""

    sensor: SensorModel
    z: Vector
    used: tuple[int, ...]
    context: Context

    @property
    def space(self) -> Manifold:
        """What is in use."""
        return self.sensor.space.part(self.used)

    @property
    def rows(self) -> tuple[int, ...]:
        """The indices (k) of the errors in use among those of the sensor."""
        return self.sensor.space.rows(self.used)


@dataclass(frozen=True)
class Linearisation:
    """Of what is in use: h the prediction, H (k, n) the Jacobian of its k errors, R (k, k) the covariance of the
    measurement noise, that of the noise inputs included; inputs (k, k): what those alone bring."""

    h: Vector
    H: Matrix
    R: Matrix
    inputs: Matrix


class SensorModel:
    """One sensor of a spec.

    Attributes: name; components: their names; m: how many; space: their errors, as many as there are degrees of
    freedom; own: the names of its inputs; takes_inputs: whether h, R or what they use contain inputs, so that an update
    needs u; partial: whether an update may be masked; turns: for each component, whether its differences are other than
    z - h.
    """

    def __init__(self, model: Model, sensor: Sensor) -> None:
        self.model = model
        self.spec = sensor
        self.name = sensor.name
        self.components = tuple(component.name for component in sensor.components)
        self.m = len(self.components)
        self.space = Manifold(self.components, sensor.rotations)
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
        self._R = model.covariance(variances(sensor) if sensor.R is None else sensor.R, self.space.errors)
        parts = {part for rotation in sensor.rotations for part in rotation.parts}
        self.turns = tuple(bool(c.residual or c.period or c.name in parts) for c in sensor.components)
        self._noises = [noise.name for noise in sensor.noise]
        predicted = [component.h for component in sensor.components]
        self._Re = model.noise_covariance(in_use(model.spec, sensor.noise, predicted), sensor.noise_covariance)
        self.takes_inputs = bool(_reach(model, sensor) & set(model.inputs))

    def predict(self, x: Sequence[Number], e: Sequence[Number], context: Context, used: Sequence[int]) -> list[Number]:
        """h of the components in use at the state x (nx) and the noise inputs e."""
        environment = self.model.environment(context, x, dict(zip(self._noises, e, strict=True)), self.own)
        return [self._h[i](environment) for i in used]

    def linearise(self, x: Vector, reading: Reading, learnt: bool = False) -> Linearisation:
        """h, H and R + M Re M^T at x (nx), M = dh/de at e = 0; learnt: without R. Raises StepError NOT_FINITE.

        Whether R is a covariance is for the update to judge, after all that could be not finite.
        """
        n, k = self.model.n, len(self._noises)
        joint = at_zero(n + k)
        around = self.model.space.plus(x.tolist(), joint[:n])
        predicted = self.predict(around, joint[n:], reading.context, reading.used)
        h = values(predicted)
        derivatives = jacobian(reading.space.minus(predicted, h.tolist()), n + k)
        H, M = derivatives[:, :n], derivatives[:, n:]
        inputs = M @ self.input_covariance(x, reading.context) @ M.T
        R = symmetric(inputs if learnt else self.noise(x, reading.context, reading.used) + inputs)
        if not (np.isfinite(h).all() and np.isfinite(H).all() and np.isfinite(R).all()):
            raise StepError(Status.NOT_FINITE)
        return Linearisation(h, H, R, symmetric(inputs))

    def noise(self, x: Vector, context: Context, used: Sequence[int] | None = None) -> Matrix:
        """R (k, k) of the components in use at x (nx), without the noise inputs."""
        rows = None if used is None else self.space.rows(used)
        return self._R(self.model.environment(context, x, own=self.own), rows)

    def input_covariance(self, x: Vector, context: Context) -> Matrix:
        """The covariance of the sensor's noise inputs at x (nx)."""
        return self._Re(self.model.environment(context, x, own=self.own))

    def jacobian(self, x: Vector, reading: Reading) -> Matrix:
        """H (k, n) of the components in use at x (nx); may be NaN."""
        still = [0.0] * len(self._noises)
        predicted = self.predict(self.model.space.around(x), still, reading.context, reading.used)
        return jacobian(reading.space.minus(predicted, values(predicted).tolist()), self.model.n)

    def input_share(self, x: Vector, reading: Reading, inputs: Sequence[int]) -> Matrix:
        """M Re M^T (k, k) at x (nx) of some of the noise inputs alone."""
        e: list[Number] = [0.0] * len(self._noises)
        for i, variable in zip(inputs, at_zero(len(inputs)), strict=True):
            e[i] = variable
        predicted = self.predict([float(v) for v in x], e, reading.context, reading.used)
        M = jacobian(reading.space.minus(predicted, values(predicted).tolist()), len(inputs))
        return symmetric(M @ self.input_covariance(x, reading.context)[np.ix_(inputs, inputs)] @ M.T)

    def expand(self, x: Vector, reading: Reading) -> list[Number]:
        """h of the components in use as second-order Duals in the joint variables (x, noise inputs)."""
        joint = numbers([*x, *np.zeros(len(self._noises))], order=2)
        return self.predict(joint[: self.model.n], joint[self.model.n :], reading.context, reading.used)

    def residual(self, x: Vector, reading: Reading) -> Vector:
        """z - h(x) of the components in use, as `innovation` has it. Raises StepError NOT_FINITE."""
        still = [0.0] * len(self._noises)
        predicted = self.predict([float(v) for v in x], still, reading.context, reading.used)
        return self.innovation(values(predicted), x, reading)

    def innovation(self, h: Vector, x: Vector, reading: Reading) -> Vector:
        """z - h of the components in use, as `difference` has it; h is the prediction made at x (nx)."""
        return self.difference(reading.z[list(reading.used)], h, x, reading)

    def difference(
        self, z: Vector, h: Vector, x: Vector, reading: Reading, wrapped: Sequence[int] | None = None
    ) -> Vector:
        """z [-] h (k) of the components in use, wrapped where periodic, or by the component's own residual.

        wrapped: the components that are, if not all. An own residual may use x (nx) as h does. Raises StepError
        NOT_FINITE.
        """
        environment = self.model.environment(reading.context, x, own=self.own)
        y = reading.space.difference(z, h)
        for block in reading.space.blocks:
            i, k = reading.used[block.number], block.error
            residual, period = self._residuals[i], self._periods[i]
            if block.rotation is not None or (residual is None and period is None):
                continue
            measured, predicted = float(z[block.number]), float(h[block.number])
            if residual is not None:
                environment[self.model.scope.slots[Z]] = measured
                environment[self.model.scope.slots[PREDICTED]] = predicted
                y[k] = value_of(residual(environment))
            elif period is not None and (wrapped is None or i in wrapped):
                y[k] = wrap(measured - predicted, period)
        if not np.isfinite(y).all():
            raise StepError(Status.NOT_FINITE)
        return y


def _reach(model: Model, sensor: Sensor) -> set[str]:
    """Every name that the sensor's formulas use, through definitions too."""
    formulas: list[Expression | None] = []
    formulas += [component.h for component in sensor.components] + list(variances(sensor).values())
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
