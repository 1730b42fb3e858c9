"""From a spec to its symbolic model: every formula in the scope of its names, every constant by its exact value."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import sympy

from kfgen.errors import Mistake, SpecError
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace
from kfgen.model.first import build_firsts
from kfgen.model.model import Model, NoiseModel, OutputModel, SensorModel
from kfgen.model.options import INNOVATION, Options, build_gate, build_options
from kfgen.model.rotations import Names, Registry, increment, rotation_models
from kfgen.model.start import initial_covariance
from kfgen.model.symbolic import constants, to_sympy
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Expression, Name
from kfgen.spec.types import Filter, Matrix, Noise, Sensor, Spec, error_names

Symbolic = Any  # a SymPy expression


def build_model(spec: Spec) -> Model:
    """The model of a validated spec.

    Raises SpecError for what only algebra can tell (an equation of a kf that is not linear, ...).
    """
    return _Builder(spec).build()


class _Builder:
    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.registry = Registry({r.parts: r.name for r in spec.rotations})
        self.names = Names({}, self.registry)
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
        n = len(spec.errors)
        dynamics = spec.dynamics
        turns = self.turns()
        turning = {part for r, turn in zip(spec.rotations, turns, strict=True) if turn is not None for part in r.parts}
        default = [self.names[s.name] if dynamics.form == "discrete" else sympy.S.Zero for s in spec.states]
        f = tuple(
            self.tree(dynamics.f[s.name]) if s.name in dynamics.f and s.name not in turning else d
            for s, d in zip(spec.states, default, strict=True)
        )
        places = tuple(dynamics.f[s.name].place if s.name in dynamics.f else dynamics.place for s in spec.states)
        if isinstance(dynamics.Q, Mapping):
            diagonal = [self.tree(dynamics.Q[name]) if name in dynamics.Q else sympy.S.Zero for name in spec.errors]
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
        options = self.options(spec.filter)
        Q_noise = self.covariance(spec.noise, spec.noise_covariance)
        outputs = tuple(OutputModel(o.name, self.tree(o.value)) for o in spec.outputs)
        firsts = build_firsts(spec, self.names)
        return Model(
            spec=spec,
            symbols={**self.symbols, **{name: sympy.Symbol(name) for name in self.registry.values}},
            definitions=definitions + tuple(self.registry.values.items()),
            rotations=rotation_models(spec.rotations, [s.name for s in spec.states]),
            turns=turns,
            turned=self.registry.turned,
            f=f,
            f_places=places,
            noises=self.noises(spec.noise),
            noise_covariance=Q_noise,
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
            options=options,
            firsts=firsts,
            outputs=outputs,
        )

    def turns(self) -> tuple[tuple[Symbolic, ...] | None, ...]:
        """How a step turns each quaternion; see Model."""
        dynamics, out = self.spec.dynamics, list[tuple[Symbolic, ...] | None]()
        lets = {d.name: d.value.tree for d in self.spec.let}
        for rotation in self.spec.rotations:
            if dynamics.form != "discrete":
                rates = [dynamics.f.get(name) for name in rotation.errors]
                out.append(tuple(sympy.S.Zero if e is None else self.tree(e) for e in rates))
            elif any(name in dynamics.f for name in rotation.parts):
                numbers = [dynamics.f[name].tree if name in dynamics.f else Name(name) for name in rotation.parts]
                found = increment(numbers, rotation.parts, lets)
                out.append(None if found is None else tuple(to_sympy(tree, self.names) for tree in found))
            else:
                out.append((sympy.S.Zero,) * 3)
        return tuple(out)

    def options(self, chosen: Filter) -> Options:
        names = Names({**self.names, INNOVATION.name: INNOVATION}, self.registry)
        return build_options(chosen, list(self.spec.errors), self.number, lambda e: self.tree(e, names))

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
        return tuple(self.number(values[name]) if name in values else None for name in self.spec.errors)

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
        components = [c.name for c in sensor.components]
        if sensor.R is not None:
            R = self.matrix(sensor.R)
        else:
            given = {c.name: c.variance for c in sensor.components}
            given |= {name: v for r in sensor.rotations for name, v in zip(r.errors, r.variances, strict=True)}
            names = error_names(components, sensor.rotations)
            m = len(names)
            variances = [sympy.S.Zero if (v := given[name]) is None else self.tree(v) for name in names]
            R = tuple(tuple(variances[i] if i == j else sympy.S.Zero for j in range(m)) for i in range(m))
        residuals: list[Symbolic | None] = []
        for c in sensor.components:
            if c.residual is None:
                residuals.append(None)
                continue
            own = {"z": sympy.Symbol(f"z_{c.name}"), "h": sympy.Symbol(f"h_{c.name}")}
            residuals.append(self.tree(c.residual, Names({**self.names, **own}, self.registry)))
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
            rotations=rotation_models(sensor.rotations, components),
        )
