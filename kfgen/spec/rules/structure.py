"""What a model must have, and what goes with what: sections, forms of dynamics, measurements that measure."""

from __future__ import annotations

from kfgen.errors import Place
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD
from kfgen.spec.rules.facts import Facts, Model
from kfgen.spec.tree import Expression
from kfgen.spec.types import Sensor


def check(facts: Facts) -> None:
    _sections(facts)
    for model in facts.models():
        _dynamics(facts, model)
        for sensor in model.measurements:
            _sensor(facts, sensor, model)
    _initialize(facts)


def _sections(facts: Facts) -> None:
    spec = facts.spec
    if spec.imm is None:
        for key, hint in (
            ("dynamics", "write `dynamics: {f: {}}` for states that stay as they are"),
            ("measurements", "a filter needs a sensor"),
        ):
            if not facts.written(key) and key not in facts.walker.meant and not facts.written("imm"):
                place = Place(spec.file, spec.place.line, spec.place.column, key)
                facts.add(place, f"the key `{key}` is missing", hint)
    empty = [("states", bool(spec.states), "state"), ("measurements", bool(spec.measurements), "sensor")]
    for key, filled, what in empty:
        if facts.empty(key) and not filled:
            facts.add(facts.at(key), f"there is no {what}", f"name at least one {what}")


def _dynamics(facts: Facts, model: Model) -> None:
    dynamics = model.dynamics
    no_step = facts.spec.dt is None and not facts.written("dt")
    if dynamics.form == "continuous" and no_step and not facts.scopes.said_dt and "dt" not in facts.walker.meant:
        facts.add(dynamics.place, "`form: continuous` needs a step, but the spec has no key `dt`", "write `dt: 0.1`")
    for noise in model.noise:
        if noise.density and dynamics.form != "continuous" and not facts.broken(f"{dynamics.place.path}.form"):
            path = noise.place.path
            at = facts.at(f"{path}.density", f"{path}.root_density", otherwise=noise.place)
            facts.add(at, "a density is used in continuous form only", "write `std` or `var` per step")


def _sensor(facts: Facts, sensor: Sensor, model: Model) -> None:
    if not sensor.components and facts.empty(f"{sensor.place.path}.z"):
        facts.add(sensor.place, f"the sensor {short(sensor.name)} has no component", "write `z: {x: {h: ...}}`")
    states = {state.name for state in facts.spec.states}
    doubtful = facts.scopes.doubtful
    for component in sensor.components:
        if component.h.tree == BAD or not states:
            continue
        used = model.context.uses(component.h)
        unknown = [n for n in used if model.context.kind_of(n) is None]
        if not used & states and not unknown and not used & doubtful:
            facts.add(component.h.place, "h depends on no state, so it measures nothing", "write what is measured")
        if component.residual is not None and component.residual.tree != BAD:
            _residual(facts, component.residual, model)


def _residual(facts: Facts, residual: Expression, model: Model) -> None:
    missing = [name for name in ("z", "h") if name not in model.context.uses(residual)]
    if missing:
        listed = " and ".join(f"`{name}`" for name in missing)
        facts.add(residual.place, f"the residual does not depend on {listed}", "write for example `z - h`")


def _initialize(facts: Facts) -> None:
    for initialize in facts.spec.initialize:
        path = f"{initialize.place.path}.states"
        if not initialize.states and facts.empty(path):
            facts.add(facts.at(path), "no state is set", "write `states: {px: x}`")
