"""The symbolic model of a spec: everything a filter needs to know of it, exact and in the spec's order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import sympy

from kfgen.errors import Mistake, Place, SpecError
from kfgen.geometry import Part, part_of
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace
from kfgen.model.first import FirstModel, build_firsts
from kfgen.model.options import INNOVATION, GateModel, Options, build_gate, build_options
from kfgen.model.start import initial_covariance
from kfgen.model.symbolic import constants, partials, to_sympy
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Expression
from kfgen.spec.types import Filter, Matrix, Noise, Sensor, Spec

Symbolic = Any  # a SymPy expression


@dataclass(frozen=True)
class NoiseModel:
    """A noise input: its symbol, and whether its covariance is a power spectral density."""

    name: str
    symbol: Symbolic
    density: bool


@dataclass(frozen=True)
class SensorModel:
    """One sensor of m components. h: (m,), R: (m, m), noise covariance (q, q) over `noises`."""

    spec: Sensor
    h: tuple[Symbolic, ...]
    residual: tuple[Symbolic | None, ...]  # in the symbols z_<component> and h_<component>
    R: tuple[tuple[Symbolic, ...], ...]
    periods: tuple[Fraction | None, ...]
    noises: tuple[NoiseModel, ...]
    noise_covariance: tuple[tuple[Symbolic, ...], ...]
    gate: GateModel | None
    options: Options | None = None  # where it has some of its own

    @property
    def name(self) -> str:
        return self.spec.name

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The geometry of each component."""
        return tuple(part_of(period) for period in self.periods)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Known values that come with a measurement; their fields stand behind the components'."""
        return tuple(i.name for i in self.spec.inputs)

    @property
    def dimension(self) -> int:
        """Degrees of freedom of an innovation."""
        return sum(part.dimension for part in self.parts)


@dataclass(frozen=True)
class OutputModel:
    """What firmware reads: a function of the state, parameters and t."""

    name: str
    value: Symbolic


@dataclass(frozen=True)
class Model:
    """The model of a spec with n states. f: x[k+1], or dx/dt where the form is continuous."""

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
    _partials: dict[Symbolic, tuple[tuple[Symbolic, Symbolic], ...]] = field(default_factory=dict, repr=False)

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(s.name for s in self.spec.states)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The geometry of each state."""
        return tuple(part_of(period) for period in self.periods)

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
        return [*self.f, *(e for m in (self.Q, self.noise_covariance) for row in m for e in row)]

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


def build_model(spec: Spec) -> Model:
    """The model of a validated spec.

    Raises SpecError for what only algebra can tell (an equation of a kf that is not linear, ...).
    """
    return _Builder(spec).build()


class _Builder:
    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.names: dict[str, Symbolic] = {}
        self.symbols: dict[str, Symbolic] = {}
        self.mistakes: list[Mistake] = []
        self.lowering = Lowering(Trace(), {})

    def build(self) -> Model:
        spec = self.spec
        self.names |= constants(spec.constants, lambda e: self.lowering(e).constant)
        # a fixed step and initial values may use parameters: at their spec values
        parameters = [(p.name, self.number(p.value)) for p in spec.parameters]
        folded = {
            **self.names,
            **{name: sympy.Rational(v.numerator, v.denominator) for name, v in parameters},
        }
        step = spec.dt
        nominal = self.number(step.nominal, folded) if step is not None else None
        fixed = nominal if step is not None and not step.run_time else None
        if fixed is not None:
            self.names["dt"] = folded["dt"] = sympy.Rational(fixed.numerator, fixed.denominator)
        for name in [*(n for n, _ in parameters), *(s.name for s in spec.states), *(i.name for i in spec.inputs),
                     *(w.name for w in spec.noise), *(d.name for d in spec.let), "t",
                     *([] if fixed is not None else ["dt"])]:  # fmt: skip
            self.declare(name)
        definitions = tuple((d.name, self.tree(d.value)) for d in spec.let)
        n = len(spec.states)
        dynamics = spec.dynamics
        default = [self.names[s.name] if dynamics.form == "discrete" else sympy.S.Zero for s in spec.states]
        f = tuple(
            self.tree(dynamics.f[s.name]) if s.name in dynamics.f else d
            for s, d in zip(spec.states, default, strict=True)
        )
        places = tuple(dynamics.f[s.name].place if s.name in dynamics.f else dynamics.place for s in spec.states)
        if isinstance(dynamics.Q, Mapping):
            diagonal = [self.tree(dynamics.Q[s.name]) if s.name in dynamics.Q else sympy.S.Zero for s in spec.states]
            Q = tuple(tuple(diagonal[i] if i == j else sympy.S.Zero for j in range(n)) for i in range(n))
        else:
            Q = self.matrix(dynamics.Q)
        limits: tuple[Fraction | None, Fraction | None] = (None, None)
        if step is not None and step.run_time:
            limits = (
                None if step.minimum is None else self.number(step.minimum),
                None if step.maximum is None else self.number(step.maximum),
            )
        sensors = tuple(self.sensor(s) for s in spec.measurements)
        return Model(
            spec=spec,
            symbols=self.symbols,
            definitions=definitions,
            f=f,
            f_places=places,
            noises=self.noises(spec.noise),
            noise_covariance=self.covariance(spec.noise, spec.noise_covariance),
            Q=Q,
            sensors=sensors,
            x0=tuple(self.number(s.init, folded) for s in spec.states),
            P0=initial_covariance(spec, lambda e: self.number(e, folded)),
            periods=tuple(None if s.period is None else self.number(s.period) for s in spec.states),
            bounds=tuple(
                None if s.bounds is None else (self.number(s.bounds[0]), self.number(s.bounds[1])) for s in spec.states
            ),
            floors=self.limits(spec.filter.variance_floor),
            ceilings=self.limits(spec.filter.variance_ceiling),
            parameters=tuple(parameters),
            dt=fixed,
            dt_limits=limits,
            options=self.options(spec.filter),
            firsts=build_firsts(spec, self.names),
            outputs=tuple(OutputModel(o.name, self.tree(o.value)) for o in spec.outputs),
        )

    def options(self, chosen: Filter) -> Options:
        names = {**self.names, INNOVATION.name: INNOVATION}
        states = [s.name for s in self.spec.states]
        return build_options(chosen, states, self.number, lambda e: self.tree(e, names))

    # pieces ------------------------------------------------------------------------------------------

    def declare(self, name: str) -> None:
        self.symbols[name] = self.names[name] = sympy.Symbol(name)

    def tree(self, expression: Expression, names: Mapping[str, Symbolic] | None = None) -> Symbolic:
        return to_sympy(expression.tree, self.names if names is None else names)

    def number(self, expression: Expression, names: Mapping[str, Symbolic] | None = None) -> Fraction:
        """The exact value of a constant expression."""
        try:
            value = self.lowering(self.tree(expression, names)).constant
        except KeyError:
            value = None
        if value is None:
            raise SpecError.at(expression.place, f"`{expression.text}` is not a constant with a finite value")
        return value

    def matrix(self, rows: Matrix) -> tuple[tuple[Symbolic, ...], ...]:
        return tuple(tuple(self.tree(e) for e in row) for row in rows)

    def limits(self, values: Mapping[str, Expression]) -> tuple[Fraction | None, ...]:
        return tuple(self.number(values[s.name]) if s.name in values else None for s in self.spec.states)

    def noises(self, noises: tuple[Noise, ...]) -> tuple[NoiseModel, ...]:
        return tuple(NoiseModel(w.name, self.names[w.name], w.density) for w in noises)

    def covariance(self, noises: tuple[Noise, ...], full: Matrix | None) -> tuple[tuple[Symbolic, ...], ...]:
        if full is not None:
            return self.matrix(full)
        variances = [sympy.S.Zero if w.variance is None else self.tree(w.variance) for w in noises]
        q = len(noises)
        return tuple(tuple(variances[i] if i == j else sympy.S.Zero for j in range(q)) for i in range(q))

    def sensor(self, sensor: Sensor) -> SensorModel:
        for name in (*(w.name for w in sensor.noise), *(i.name for i in sensor.inputs)):
            self.declare(name)
        m = len(sensor.components)
        if sensor.R is not None:
            R = self.matrix(sensor.R)
        else:
            variances = [sympy.S.Zero if c.variance is None else self.tree(c.variance) for c in sensor.components]
            R = tuple(tuple(variances[i] if i == j else sympy.S.Zero for j in range(m)) for i in range(m))
        residuals: list[Symbolic | None] = []
        for c in sensor.components:
            if c.residual is None:
                residuals.append(None)
                continue
            names = {**self.names, "z": sympy.Symbol(f"z_{c.name}"), "h": sympy.Symbol(f"h_{c.name}")}
            residuals.append(self.tree(c.residual, names))
        return SensorModel(
            spec=sensor,
            h=tuple(self.tree(c.h) for c in sensor.components),
            residual=tuple(residuals),
            R=R,
            periods=tuple(None if c.period is None else self.number(c.period) for c in sensor.components),
            noises=self.noises(sensor.noise),
            noise_covariance=self.covariance(sensor.noise, sensor.noise_covariance),
            gate=build_gate(sensor.gate, self.number, self.tree),
            options=self.options(filter_of(self.spec.filter, sensor)) if sensor.own else None,
        )
