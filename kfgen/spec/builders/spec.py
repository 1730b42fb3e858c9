"""The raw data of a whole file -> Spec: the top of it here, its parts by the other builders."""

from __future__ import annotations

from kfgen.scalar_names import FLOAT, KNOWN, is_scalar
from kfgen.spec.builders.filter import FilterBuilder
from kfgen.spec.builders.model import ModelBuilder
from kfgen.spec.builders.modes import ModesBuilder
from kfgen.spec.builders.values import Values
from kfgen.spec.constants import keep
from kfgen.spec.problems import short
from kfgen.spec.raw import Fields, Word, entries, limits, matrix
from kfgen.spec.shaping.shaper import Shaper
from kfgen.spec.tree import Expression
from kfgen.spec.types import Code, Constant, Fixed, History, Initialize, Output, Parameter, Spec, Step, error_names
from kfgen.spec.walk import Walker


class Builder:
    """Builds one spec; mistakes go to the walker's problems."""

    def __init__(self, walker: Walker, top: Fields) -> None:
        self.walker = walker
        self.problems = walker.problems
        self.shaper = Shaper(walker, top)
        self.top = self.shaper.flat()
        self.values = Values(walker)
        self.model = ModelBuilder(self.values)
        self.filters = FilterBuilder(self.values)

    def build(self, file: str, sha256: str) -> Spec:
        top = self.top
        constants = self.constants()
        states = self.model.states(top.get("states"), covered="P0" in top)
        raw = self.shaper.model.rotations.get(("states",), [])
        rotations = self.model.rotations(raw, covered="P0" in top)
        errors = error_names((state.name for state in states), rotations)
        noise = self.model.noises(top.get("noise"), "noise_covariance" in top)
        self.values.both(top, "P0", self.shaper.top.get("states"))
        self.values.both(top, "noise_covariance", self.shaper.top.get("noise"))
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
            covariances=self.model.covariances(top),
            P0=matrix(top.get("P0")),
            initialize=self.initialize(),
            inputs=self.model.inputs(top.get("inputs")),
            noise=noise,
            noise_covariance=self.model.noise_covariance(top, noise),
            let=self.model.definitions(top.get("let"), self.shaper.hidden((key,) for key in top.values)),
            dynamics=self.model.dynamics(top.get("dynamics")),
            measurements=self.model.sensors(top.get("measurements")),
            filter=self.filters.filter(top.get("filter"), errors),
            fixed=self.fixed(),
            code=self.code(),
            history=self.history(),
            groups=tuple(self.shaper.groups.values()),
            rotations=rotations,
            outputs=self.outputs(),
            advice=tuple(name for name in top.get("advice", ()) if name is not None),
            place=top.place,
            places=dict(top.places),
        )
        if "P0" in top and "covariances" in top:
            self.problems.add(top.at("covariances"), "`P0` is given too", "write the covariances into P0")
        if not isinstance(imm, Fields):
            return spec
        return ModesBuilder(self.values, self.model, self.filters, top, self.shaper).with_modes(spec, imm)

    def scalar(self) -> str:
        text = self.top.get("scalar", FLOAT)
        if not is_scalar(text):
            at = self.walker.value_place("scalar", self.top.at("scalar"))
            self.problems.add(at, f"there is no scalar {short(text)}", KNOWN)
            return FLOAT
        return str(text)

    def constants(self) -> tuple[Constant, ...]:
        found = []
        for name, expression in entries(self.top.get("constants")):
            found.append(Constant(name, expression))
            keep(self.values.environment, name, expression.tree)
        return tuple(found)

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(name, self.values.formula(f, "value"), f.get("unit", ""), limits(f, "range"), f.get("doc", ""))
            for name, f in entries(self.top.get("parameters"))
        )

    def step(self) -> Step | None:
        written = self.top.get("dt")
        if isinstance(written, Fields):
            return Step(self.values.formula(written, "nominal"), True, written.get("min"), written.get("max"))
        if isinstance(written, Expression):
            return Step(written)
        return Step(self.values.bad(self.top.at("dt"))) if "dt" in self.top else None

    def outputs(self) -> tuple[Output, ...]:
        return tuple(
            Output(name, self.values.formula(f, "value"), f.get("unit", ""), f.get("doc", ""), f.place)
            for name, f in entries(self.top.get("outputs"))
        )

    def initialize(self) -> tuple[Initialize, ...]:
        found = []
        for rule in self.top.get("initialize", ()):
            sensor = rule.get("from")
            states, variance = (dict(entries(rule.get(key))) for key in ("states", "var"))
            name = sensor.text if isinstance(sensor, Word) else ""
            found.append(Initialize(name, states, variance, rule.get("let", ()), rule.place, rule.get("waits", False)))
        return tuple(found)

    # --- options

    def fixed(self) -> Fixed:
        f = self.top.get("fixed")
        if not isinstance(f, Fields):
            return Fixed()
        scale = f.get("scale")
        by_state = dict(entries(scale)) if isinstance(scale, Fields) else None
        at = f.places.get("log", f.place)
        return Fixed(by_state, f.get("rounding", "nearest"), f.get("overflow", "saturate"), f.get("log"), at)

    def history(self) -> History | None:
        f = self.top.get("history")
        if not isinstance(f, Fields):
            return None
        number = self.values.number
        steps, per_step, keep = number(f.get("steps")), number(f.get("per_step")), number(f.get("keep"))
        return History(steps or 1, per_step or 4, keep or 1, f.place, dict(f.places))

    def compensated(self, written: object) -> tuple[str, ...]:
        if isinstance(written, bool):
            states = self.top.get("states")
            return tuple(name for name, _ in entries(states)) if written and isinstance(states, Fields) else ()
        words = written if isinstance(written, list | tuple) else ()
        return tuple(word.text for word in words if isinstance(word, Word))

    def code(self) -> Code:
        f = self.top.get("code")
        if not isinstance(f, Fields):
            return Code()
        unroll = f.get("unroll", "auto")
        own = isinstance(unroll, Fields)
        return Code(
            "auto" if own else unroll,
            {name: how for name, how in entries(unroll) if how is not None} if own else {},
            self.values.number(f.get("flash")),
            self.values.number(f.get("ram")),
            self.values.number(f.get("stack")),
            f.get("log_likelihood", False),
            f.get("gate_count", False),
            self.compensated(f.get("compensated", False)),
            dict(f.places),
        )
