"""Checked raw data -> the frozen dataclasses of `types.py`, with the documented defaults filled in.

What is wrong beyond a single key (both std and var, a missing variance) is said here, where the keys are
at hand; what needs values or names is said by the rules, on the finished spec.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.errors import Place
from kfgen.spec.build_filter import FilterBuilder
from kfgen.spec.build_modes import with_modes
from kfgen.spec.constants import NotConstant, NoValue, Value, keep, value
from kfgen.spec.names import SCALARS, is_scalar
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD, Fields, Word, entries, limits, matrix, path_text
from kfgen.spec.tree import Call, Expression, Name, Number, names
from kfgen.spec.types import (
    Code,
    Component,
    Constant,
    Covariance,
    Definition,
    Dynamics,
    Fixed,
    Gate,
    Initialize,
    Input,
    Noise,
    Parameter,
    Sensor,
    Spec,
    State,
    Step,
)
from kfgen.spec.walk import Walker


class Builder:
    """Builds one spec; mistakes go to the walker's problems."""

    def __init__(self, walker: Walker, top: Fields) -> None:
        self.walker = walker
        self.problems = walker.problems
        self.top = top
        self.environment: dict[str, Value] = {}  # of the constants
        self.filters = FilterBuilder(self)

    def build(self, file: str, sha256: str) -> Spec:
        top = self.top
        constants = self.constants()
        states = self.states(top.get("states"), covered="P0" in top)
        self.both(top, "P0", top.get("states"))
        self.both(top, "noise_covariance", top.get("noise"))
        imm = top.get("imm")
        spec = Spec(
            name=top.get("name", ""),
            file=file,
            sha256=sha256,
            description=top.get("description", ""),
            scalar=self.scalar(),
            constants=constants,
            parameters=self.parameters(),
            dt=self.step(),
            states=states,
            covariances=self.covariances(top),
            P0=matrix(top.get("P0")),
            initialize=self.initialize(),
            inputs=self.inputs(),
            noise=self.noises(top.get("noise"), "noise_covariance" in top),
            noise_covariance=matrix(top.get("noise_covariance")),
            let=self.definitions(top.get("let")),
            dynamics=self.dynamics(top.get("dynamics")),
            measurements=self.sensors(top.get("measurements")),
            filter=self.filters.filter(top.get("filter"), states),
            fixed=self.fixed(),
            code=self.code(),
            place=top.place,
            places=dict(top.places),
        )
        if "P0" in top and "covariances" in top:
            self.problems.add(top.at("covariances"), "`P0` is given too", "write the covariances into P0")
        return with_modes(self, spec, imm) if isinstance(imm, Fields) else spec

    def bad(self, place: Place) -> Expression:
        return Expression(BAD, "", place)

    def number(self, expression: Any) -> int | None:
        """The value of a whole-number key (whether it is whole and in range is a rule)."""
        if expression is None or isinstance(expression, int):
            return expression
        try:
            found = value(expression.tree, self.environment)
        except (NotConstant, NoValue):
            return None
        return int(found)

    # --- the top

    def scalar(self) -> str:
        text = self.top.get("scalar", "float")
        if not is_scalar(text):
            at = self.walker.value_place("scalar", self.top.at("scalar"))
            self.problems.add(at, f"there is no scalar {short(text)}", SCALARS)
            return "float"
        return str(text)

    def constants(self) -> tuple[Constant, ...]:
        found = []
        for name, expression in entries(self.top.get("constants")):
            found.append(Constant(name, expression))
            keep(self.environment, name, expression.tree)
        return tuple(found)

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(name, self.formula(f, "value"), f.get("unit", ""), limits(f, "range"), f.get("doc", ""))
            for name, f in entries(self.top.get("parameters"))
        )

    def formula(self, fields: Fields, key: str) -> Expression:
        found = fields.get(key)
        return found if isinstance(found, Expression) else self.bad(fields.at(key))

    def step(self) -> Step | None:
        written = self.top.get("dt")
        if isinstance(written, Fields):
            return Step(self.formula(written, "nominal"), True, written.get("min"), written.get("max"))
        if isinstance(written, Expression):
            return Step(written)
        return Step(self.bad(self.top.at("dt"))) if "dt" in self.top else None

    def inputs(self) -> tuple[Input, ...]:
        return tuple(
            Input(name, f.get("unit", ""), limits(f, "range"), f.get("doc", ""))
            for name, f in entries(self.top.get("inputs"))
        )

    def definitions(self, written: Any) -> tuple[Definition, ...]:
        """In an order in which each uses only those before it; a cycle is reported once."""
        found = {name: Definition(name, expression) for name, expression in entries(written)}
        order: list[Definition] = []
        state: dict[str, int] = {}  # 1: on the way, 2: done

        def visit(name: str, trail: list[str]) -> None:
            stack: list[tuple[str, list[str]]] = [(name, used(found[name]))]
            state[name] = 1
            while stack:
                current, rest = stack[-1]
                if not rest:
                    stack.pop()
                    state[current] = 2
                    order.append(found[current])
                    continue
                other = rest.pop()
                if state.get(other) == 1:
                    trail = [n for n, _ in stack]
                    cycle = [*trail[trail.index(other) :], other]
                    self.problems.add(
                        found[cycle[0]].value.place,
                        "the definitions use each other in a circle: " + " -> ".join(cycle),
                        "break the circle",
                    )
                elif other not in state:
                    state[other] = 1
                    stack.append((other, used(found[other])))

        def used(definition: Definition) -> list[str]:
            return [n for n in reversed(list(dict.fromkeys(names(definition.value.tree)))) if n in found]

        for name in found:
            if name not in state:
                visit(name, [])
        return tuple(order)

    # --- states

    def states(self, written: Any, covered: bool) -> tuple[State, ...]:
        found = []
        for name, f in entries(written):
            kind, period = self.kind(f)
            found.append(
                State(
                    name,
                    self.formula(f, "init"),
                    self.variance(f, covered),
                    f.get("unit", ""),
                    limits(f, "range"),
                    kind,
                    period,
                    limits(f, "bounds"),
                    f.get("doc", ""),
                    f.place,
                )
            )
        return tuple(found)

    def kind(self, f: Fields) -> tuple[str, Expression | None]:
        written = f.get("kind", "real")
        if isinstance(written, Fields):
            return "periodic", self.formula(written, "periodic")
        if written != "angle":
            return "real", None
        unit = f.get("unit")
        if unit is not None and unit != "rad":
            at = self.walker.value_place(path_text((*f.path, "unit")), f.place)
            self.problems.add(
                at,
                f"a value of kind angle has the unit rad, not {unit!r}",
                "convert it, or write `kind: {periodic: 360}`",
            )
        return "angle", Expression(Call("mul", (Number(Fraction(2)), Name("pi"))), "2*pi", f.at("kind"))

    def variance(self, f: Fields, covered: bool, needed: bool = True, more: tuple[str, ...] = ()) -> Expression | None:
        """std squared, or var (or one of `more`): exactly one of them, or none where a matrix covers it."""
        given = [key for key in ("std", "var", *more) if key in f]
        if covered:
            return None
        choices = ", ".join(f"`{key}`" for key in ("std", "var", *more))
        if len(given) > 1:
            listed = " and ".join(f"`{key}`" for key in given)
            self.problems.add(f.places[given[1]], f"{listed} are given both", f"write exactly one of {choices}")
        if not given:
            if needed and not f.bad:
                if not self.mistaken(f):
                    self.problems.add(f.place, f"one of {choices} is missing", "write `std: 0` where it is exact")
                return self.bad(f.place)
            return self.bad(f.place) if f.bad else None
        expression: Expression = self.formula(f, given[0])
        if given[0] not in ("std", "root_density") or expression.tree == BAD:
            return expression
        return Expression(Call("pow", (expression.tree, Number(Fraction(2)))), expression.text, expression.place)

    def both(self, holder: Fields, matrix_key: str, written: Any) -> None:
        """A full covariance beside single variances: one mistake, whoever has them."""
        if matrix_key not in holder:
            return
        more = ("density", "root_density")
        given = [(n, key) for n, f in entries(written) for key in ("std", "var", *more) if key in f]
        if given:
            listed = ", ".join(f"`{key}` of {short(name)}" for name, key in given[:6])
            text = f"`{matrix_key}` is given, and {listed} too"
            self.problems.add(holder.at(matrix_key), text, "give the variances in one of the two")

    def mistaken(self, f: Fields) -> bool:
        """Whether an unknown key has been reported here, which was probably meant for the missing one."""
        prefix = path_text(f.path) + "."
        return any(
            m.place.path.startswith(prefix) and m.message.startswith("unknown key") for m in self.problems.mistakes
        )

    def covariances(self, top: Fields) -> tuple[Covariance, ...]:
        found = []
        for triple in top.get("covariances", ()):
            if triple is None:
                continue
            first, second, amount = triple
            if isinstance(first, Word) and isinstance(second, Word):
                found.append(Covariance(first.text, second.text, amount))
        return tuple(found)

    def initialize(self) -> Initialize | None:
        written = self.top.get("initialize")
        if not isinstance(written, Fields):
            return None
        sensor = written.get("from")
        states = {n: w.text for n, w in entries(written.get("states")) if isinstance(w, Word)}
        return Initialize(sensor.text if isinstance(sensor, Word) else "", states)

    # --- model

    def noises(self, written: Any, covered: bool, densities: bool = True) -> tuple[Noise, ...]:
        more = ("density", "root_density") if densities else ()
        found = []
        for name, f in entries(written):
            variance = self.variance(f, covered, more=more)
            density = "std" not in f and "var" not in f and ("density" in f or "root_density" in f)
            found.append(Noise(name, variance, density, f.get("unit", ""), f.get("doc", ""), f.place))
        return tuple(found)

    def dynamics(self, f: Any) -> Dynamics:
        if not isinstance(f, Fields):
            return Dynamics()
        noise = f.get("Q", {})
        return Dynamics(
            form=f.get("form", "discrete"),
            f=dict(entries(f.get("f"))),
            integrator=f.get("integrator", "rk4"),
            substeps=max(1, self.number(f.get("substeps")) or 1),
            Q=dict(entries(noise)) if isinstance(noise, Fields) else matrix(noise) or {},
            place=f.place,
        )

    def sensors(self, written: Any) -> tuple[Sensor, ...]:
        return tuple(self.sensor(name, f) for name, f in entries(written))

    def sensor(self, name: str, f: Fields) -> Sensor:
        noise = self.noises(f.get("noise"), "noise_covariance" in f, densities=False)
        self.both(f, "R", f.get("z"))
        self.both(f, "noise_covariance", f.get("noise"))
        components = tuple(self.component(n, c, "R" in f, "noise" in f) for n, c in entries(f.get("z")))
        gate = f.get("gate")
        return Sensor(
            name,
            components,
            matrix(f.get("R")),
            noise,
            matrix(f.get("noise_covariance")),
            Gate(self.formula(gate, "probability"), self.number(gate.get("reset_after")))
            if isinstance(gate, Fields)
            else None,
            f.get("partial", False),
            f.get("doc", ""),
            f.place,
        )

    def component(self, name: str, f: Fields, covered: bool, noisy: bool) -> Component:
        kind, period = self.kind(f)
        variance = self.variance(f, covered, needed=not noisy)
        if "residual" in f and kind != "real":
            self.problems.add(f.places["residual"], "`kind` wraps the residual already", "remove one of them")
        return Component(
            name,
            self.formula(f, "h"),
            variance,
            f.get("unit", ""),
            limits(f, "range"),
            kind,
            period,
            f.get("residual"),
            f.get("doc", ""),
            f.place,
        )

    # --- options

    def fixed(self) -> Fixed:
        f = self.top.get("fixed")
        if not isinstance(f, Fields):
            return Fixed()
        scale = f.get("scale")
        by_state = dict(entries(scale)) if isinstance(scale, Fields) else None
        return Fixed(by_state, f.get("rounding", "nearest"), f.get("overflow", "saturate"))

    def code(self) -> Code:
        f = self.top.get("code")
        if not isinstance(f, Fields):
            return Code()
        return Code(
            f.get("unroll", "auto"),
            self.number(f.get("flash")),
            self.number(f.get("ram")),
            self.number(f.get("stack")),
            f.get("log_likelihood", False),
            f.get("gate_count", False),
            dict(f.places),
        )
