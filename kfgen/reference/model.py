"""What a spec says about its state: names, geometry, initial estimate; and the scope of its formulas."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from kfgen.errors import SpecError
from kfgen.reference.dual import Matrix, Number, Vector, value_of
from kfgen.reference.evaluate import Closure, Environment, Scope
from kfgen.reference.exact import Exact
from kfgen.reference.linalg import check_covariance
from kfgen.reference.status import StepError
from kfgen.spec.tree import Expression
from kfgen.spec.types import Matrix as Formulas
from kfgen.spec.types import Noise, Spec

# variables of an own residual and of an influence function; what has the same name outside is hidden inside
Z, PREDICTED, INNOVATION = " z", " h", " e"


@dataclass(frozen=True)
class Context:
    """What a step is given beside the state.

    parameters: by name. u (nu): the inputs. t: seconds since init at the step's start (in an update: now).
    dt: the step in s (0 in an update). own: of an update, the sensor's own inputs.
    """

    parameters: Mapping[str, float]
    u: Vector
    t: float
    dt: float
    own: Vector = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Covariance:
    """A diagonal or full matrix (n, n) of compiled expressions."""

    n: int
    entries: tuple[tuple[int, int, Closure], ...]

    def __call__(self, environment: Environment, used: Sequence[int] | None = None) -> Matrix:
        """Its value; of the rows and columns in `used` only, the others are not even evaluated."""
        wanted = range(self.n) if used is None else used
        place = {index: k for k, index in enumerate(wanted)}
        P = np.zeros((len(place), len(place)))
        for i, j, closure in self.entries:
            if i in place and j in place:
                P[place[i], place[j]] = value_of(closure(environment))
        return P


class Model:
    """The state of a spec and the scope of its expressions.

    Attributes:
        n, states, inputs: size of the state, names of the states and of the inputs.
        periods: index of an angle or periodic state -> its period.
        x0 (n), P0 (n, n): the initial estimate, wrapped.
        values: the parameters' values in the spec.
    Raises SpecError where the initial covariance is none.
    """

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.states = tuple(state.name for state in spec.states)
        self.inputs = tuple(entry.name for entry in spec.inputs)
        self.n = len(self.states)
        self.index = {name: i for i, name in enumerate(self.states)}
        constants = _constants(spec)
        parameters = tuple(parameter.name for parameter in spec.parameters)
        first = Scope(constants, parameters)
        self.values = {
            parameter.name: float(first.compile(parameter.value)(first.empty())) for parameter in spec.parameters
        }
        noises = [noise.name for sensor in spec.measurements for noise in sensor.noise]
        noises += [noise.name for noise in spec.noise]
        # what comes with measurements; two sensors may call theirs alike
        given = [entry.name for sensor in spec.measurements for entry in sensor.inputs]
        given += [measured(sensor.name, c.name) for sensor in spec.measurements for c in sensor.components]
        own = ("t", "dt", Z, PREDICTED, INNOVATION)
        self.scope = Scope(constants, (*parameters, *self.states, *self.inputs, *noises, *given, *own))
        self._noise_slots = tuple(self.scope.slots[name] for name in noises)
        self._state_slots = tuple(self.scope.slots[name] for name in self.states)
        self._input_slots = tuple(self.scope.slots[name] for name in self.inputs)
        for definition in spec.let:
            self.scope.define(definition.name, definition.value)

        self.periods = {i: self.number(state.period) for i, state in enumerate(spec.states) if state.period is not None}
        low, high = np.full(self.n, -math.inf), np.full(self.n, math.inf)
        for i, state in enumerate(spec.states):
            if state.bounds is not None:
                low[i], high[i] = (self.number(bound) for bound in state.bounds)
        self._low, self._high = low, high
        self.x0 = self.wrap(np.array([self.number(state.init) for state in spec.states]))
        self.P0 = self._initial_covariance()

    def number(self, expression: Expression, dt: float | None = None) -> float:
        """The value of an expression that may use constants, the parameters' spec values, and dt, fixed or given."""
        environment = self.scope.empty()
        if dt is not None:
            environment[self.scope.slots["dt"]] = dt
        for name, value in self.values.items():
            environment[self.scope.slots[name]] = value
        return value_of(self.scope.compile(expression)(environment))

    def environment(
        self, context: Context, x: Sequence[Number] | Vector, noise: Mapping[str, Number] | None = None,
        own: Sequence[str] = (),
    ) -> Environment:  # fmt: skip
        """An environment with the states at x (n); noises are 0 unless given. own: names of the sensor's inputs."""
        environment, slots = self.scope.empty(), self.scope.slots
        for name, parameter in context.parameters.items():
            environment[slots[name]] = parameter
        for slot, entry in zip(self._input_slots, context.u.tolist(), strict=False):
            environment[slot] = entry
        for slot, number in zip(self._state_slots, x.tolist() if isinstance(x, np.ndarray) else x, strict=True):
            environment[slot] = float(number) if isinstance(number, np.floating) else number
        environment[slots["t"]], environment[slots["dt"]] = context.t, context.dt
        for name, entry in zip(own, context.own.tolist(), strict=True):
            environment[slots[name]] = entry
        for slot in self._noise_slots:
            environment[slot] = 0.0
        for name, number in (noise or {}).items():
            environment[slots[name]] = number
        return environment

    def covariance(self, formulas: Formulas | Mapping[str, Expression], names: Sequence[str]) -> Covariance:
        """Compiles a full matrix, or a diagonal given by name (a name not listed has 0)."""
        if isinstance(formulas, Mapping):
            place = {name: i for i, name in enumerate(names)}
            diagonal = ((place[name], self.scope.compile(entry)) for name, entry in formulas.items())
            return Covariance(len(names), tuple((i, i, closure) for i, closure in diagonal))
        return Covariance(
            len(names),
            tuple((i, j, self.scope.compile(entry)) for i, row in enumerate(formulas) for j, entry in enumerate(row)),
        )

    def noise_covariance(self, noise: Sequence[Noise], full: Formulas | None) -> Covariance:
        """Compiles the covariance of noise inputs, from their own variances or from the full matrix."""
        names = [entry.name for entry in noise]
        if full is not None:
            return self.covariance(full, names)
        return self.covariance({e.name: e.variance for e in noise if e.variance is not None}, names)

    def wrap(self, x: Vector) -> Vector:
        """x (n) with every periodic state brought into (-period/2, period/2]."""
        x = x.copy()
        for i, period in self.periods.items():
            x[i] = wrap(float(x[i]), period)
        return x

    def clip(self, x: Vector) -> Vector:
        """x (n) clipped to the states' bounds."""
        return np.clip(x, self._low, self._high)

    def _initial_covariance(self) -> Matrix:
        spec = self.spec
        P = np.zeros((self.n, self.n))
        if spec.P0 is not None:
            P = np.array([[self.number(entry) for entry in row] for row in spec.P0])
        for i, state in enumerate(spec.states):
            if state.variance is not None:
                P[i, i] = self.number(state.variance)
        for pair in spec.covariances:
            i, j = self.index[pair.first], self.index[pair.second]
            P[i, j] = P[j, i] = self.number(pair.value)
        try:
            check_covariance(P)
        except StepError:
            place = spec.places.get("P0") or spec.places.get("covariances") or spec.place
            raise SpecError.at(
                place,
                "the initial covariance is not positive semidefinite",
                "check variances and covariances",
            ) from None
        return P


def measured(sensor: str, component: str) -> str:
    """The variable of a component in what its first measurement sets: it hides what has its name outside."""
    return f" {sensor}.{component}"


def wrap(x: float, period: float) -> float:
    """x brought into (-period/2, period/2] by adding a multiple of the period; exact, and NaN stays NaN."""
    if not math.isfinite(x):
        return x
    remainder = math.remainder(x, period)
    return 0.5 * period if remainder == -0.5 * period else remainder


def _constants(spec: Spec) -> dict[str, Exact]:
    """The exact values of the compile-time constants, and of dt where it is fixed."""
    constants: dict[str, Exact] = {}
    entries = [(constant.name, constant.value) for constant in spec.constants]
    if spec.dt is not None and not spec.dt.run_time:
        entries.append(("dt", spec.dt.nominal))
    for name, expression in entries:
        exact = Scope(constants, ()).constant(expression)
        if exact is None:
            raise SpecError.at(expression.place, f"`{expression.text}` is not a number")
        constants[name] = exact
    return constants


def fixed_step(spec: Spec) -> Fraction | None:
    """The fixed step in s as a rational; None where dt is an argument of predict or the spec has none."""
    if spec.dt is None or spec.dt.run_time:
        return None
    exact = _constants(spec)["dt"]
    return exact if isinstance(exact, Fraction) else Fraction(float(exact))
