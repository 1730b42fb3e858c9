"""The symbolic model of a spec: everything a filter needs to know of it, exact and in the spec's order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from kfgen.errors import Place
from kfgen.geometry import Space, part_of
from kfgen.model.first import FirstModel
from kfgen.model.options import GateModel, Options
from kfgen.model.rotations import RotationModel, Turned
from kfgen.model.symbolic import partials
from kfgen.spec.sensors import filter_of
from kfgen.spec.types import Sensor, Spec, error_names

Symbolic = Any  # a SymPy expression


@dataclass(frozen=True)
class NoiseModel:
    """A noise input: its symbol, and whether its covariance is a power spectral density."""

    name: str
    symbol: Symbolic
    density: bool


@dataclass(frozen=True)
class SensorModel:
    """One sensor. h: of each component; R (m, m), m being the degrees of freedom of an innovation: the number of
    components, but 3 for the four of a quaternion; noise covariance (q, q) over `noises`."""

    spec: Sensor
    h: tuple[Symbolic, ...]
    residual: tuple[Symbolic | None, ...]  # in the symbols z_<component> and h_<component>
    R: tuple[tuple[Symbolic, ...], ...]
    periods: tuple[Fraction | None, ...]
    noises: tuple[NoiseModel, ...]
    noise_covariance: tuple[tuple[Symbolic, ...], ...]
    gate: GateModel | None
    options: Options | None = None  # where it has some of its own
    rotations: tuple[RotationModel, ...] = ()

    @property
    def name(self) -> str:
        return self.spec.name

    @cached_property
    def space(self) -> Space:
        """The geometry of its components."""
        return _space(self.periods, self.rotations)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Known values that come with a measurement; their fields stand behind the components'."""
        return tuple(i.name for i in self.spec.inputs)

    @property
    def dimension(self) -> int:
        """Degrees of freedom of an innovation."""
        return self.space.dimension

    @cached_property
    def errors(self) -> tuple[str, ...]:
        """The names of the entries of an innovation."""
        return error_names([c.name for c in self.spec.components], self.spec.rotations)


@dataclass(frozen=True)
class OutputModel:
    """What firmware reads: a function of the state, parameters and t."""

    name: str
    value: Symbolic


@dataclass(frozen=True)
class Model:
    """The model of a spec with n errors of its states. f: x[k+1], or dx/dt where the form is continuous.

    turns: of each rotation the rotation vector (3,) by which a step turns it on the body's side, or its rate in the
    body's frame where the form is continuous; None: f has its four numbers.
    """

    spec: Spec
    symbols: Mapping[str, Symbolic]
    definitions: tuple[tuple[str, Symbolic], ...]
    f: tuple[Symbolic, ...]
    f_places: tuple[Place, ...]
    noises: tuple[NoiseModel, ...]
    noise_covariance: tuple[tuple[Symbolic, ...], ...]
    Q: tuple[tuple[Symbolic, ...], ...]
    sensors: tuple[SensorModel, ...]
    x0: tuple[Fraction, ...]
    P0: tuple[tuple[Fraction, ...], ...]
    periods: tuple[Fraction | None, ...]
    bounds: tuple[tuple[Fraction, Fraction] | None, ...]
    floors: tuple[Fraction | None, ...]
    ceilings: tuple[Fraction | None, ...]
    parameters: tuple[tuple[str, Fraction], ...]
    dt: Fraction | None  # None: given at run time
    dt_limits: tuple[Fraction | None, Fraction | None] = (None, None)
    options: Options = field(default_factory=Options)
    outputs: tuple[OutputModel, ...] = ()
    firsts: tuple[FirstModel, ...] = ()  # of a bank: its head's
    keeps_time: bool = False  # whether something outside of the model depends on t
    rotations: tuple[RotationModel, ...] = ()
    turns: tuple[tuple[Symbolic, ...] | None, ...] = ()
    turned: Mapping[str, Turned] = field(default_factory=dict)  # definitions whose derivatives are known
    _partials: dict[Symbolic, tuple[tuple[Symbolic, Symbolic], ...]] = field(default_factory=dict, repr=False)

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(s.name for s in self.spec.states)

    @property
    def errors(self) -> tuple[str, ...]:
        """The error coordinates: the states, but three of each quaternion in place of its numbers."""
        return self.spec.errors

    @cached_property
    def space(self) -> Space:
        """The geometry of the state."""
        return _space(self.periods, self.rotations)

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(i.name for i in self.spec.inputs)

    def partials(self, expression: Symbolic) -> tuple[tuple[Symbolic, Symbolic], ...]:
        """(symbol, derivative) of an expression for every symbol on which it depends."""
        found = self._partials.get(expression)
        if found is None:
            found = self._partials[expression] = partials(expression)
        return found

    def uses(self, *expressions: Symbolic) -> set[str]:
        """Names on which expressions depend, through definitions too."""
        definitions = dict(self.definitions)
        found: set[str] = set()
        stack = [s.name for e in expressions for s in e.free_symbols]
        while stack:
            name = stack.pop()
            if name not in found:
                found.add(name)
                if name in definitions:
                    stack += [s.name for s in definitions[name].free_symbols]
        return found

    def sensor_expressions(self, sensor: SensorModel) -> list[Symbolic]:
        """All expressions that an update of the sensor evaluates."""
        out = [*sensor.h, *(r for r in sensor.residual if r is not None)]
        out += [] if sensor.gate is None or sensor.gate.threshold is None else [sensor.gate.threshold]
        for matrix in (sensor.R, sensor.noise_covariance):
            out += [entry for row in matrix for entry in row]
        return out

    def dynamics_expressions(self) -> list[Symbolic]:
        turns = [e for turn in self.turns if turn is not None for e in turn]
        return [*self.f, *turns, *(e for m in (self.Q, self.noise_covariance) for row in m for e in row)]

    @property
    def every_options(self) -> tuple[Options, ...]:
        """Those of the filter, and those that sensors have of their own."""
        return (self.options, *(s.options for s in self.sensors if s.options is not None))

    def of(self, sensor: SensorModel) -> Model:
        """With the options of one sensor."""
        if sensor.options is None:
            return self
        spec = replace(self.spec, filter=filter_of(self.spec.filter, sensor.spec))
        return replace(self, spec=spec, options=sensor.options)

    def first(self, sensor: SensorModel) -> FirstModel | None:
        """What the first measurement of a sensor sets."""
        return next((rule for rule in self.firsts if rule.sensor == sensor.name), None)

    @property
    def waits(self) -> bool:
        """Whether nothing is done until certain sensors have come."""
        return any(rule.waits for rule in self.firsts)

    def uses_time(self) -> bool:
        """Whether anything depends on t, so that the filter has to keep it."""
        all_expressions = [*self.dynamics_expressions(), *(output.value for output in self.outputs)]
        for sensor in self.sensors:
            all_expressions += self.sensor_expressions(sensor)
        return self.keeps_time or "t" in self.uses(*all_expressions)


def _space(periods: tuple[Fraction | None, ...], rotations: tuple[RotationModel, ...]) -> Space:
    first = {rotation.first: rotation.geometry for rotation in rotations}
    others = {rotation.first + k for rotation in rotations for k in (1, 2, 3)}
    return Space(tuple(first.get(i, part_of(period)) for i, period in enumerate(periods) if i not in others))
