"""Filter options that exclude each other, with the reason; and what a filter type asks of the model."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.errors import Place
from kfgen.spec.affine import Affine
from kfgen.spec.constants import keep
from kfgen.spec.operations import Value
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD
from kfgen.spec.rules.facts import Facts, Model
from kfgen.spec.rules.points import check_points
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Expression
from kfgen.spec.types import Filter, Sensor

_VARYING = {"parameter": "parameters", "input": "inputs", "state": "states", "t": "t", "dt": "a run-time dt"}


def check(facts: Facts) -> None:
    for model in facts.models():
        chosen = model.filter
        _excluded(facts, chosen)
        _consider(facts, model)
        if chosen.type == "kf" and not model.rotations:
            _linear(facts, model)
        if chosen.gain == "steady" and facts.spec.imm is None:
            _steady(facts, model)
        for sensor in model.measurements:
            _own(facts, chosen, sensor)
            if filter_of(chosen, sensor).adapt_R is not None:
                _constant_R(facts, model, sensor)
        if chosen.adapt_Q is not None:
            _adapted_Q(facts, model)
        if chosen.sigma_points is not None:
            check_points(facts, model, chosen.sigma_points)


def _place(chosen: Filter, key: str) -> Place:
    return chosen.places.get(key, chosen.place)


def _excluded(facts: Facts, chosen: Filter) -> None:
    if chosen.sequential and chosen.covariance != "ud":
        text = f"`sequential: true` does not go with `covariance: {chosen.covariance}`: it works on U and D"
        facts.add(_place(chosen, "sequential"), text, "write `covariance: ud`, or leave `sequential` out")
    if chosen.robust is not None and chosen.type == "ukf" and not chosen.sequential:
        text = "`robust` does not go with a whole-vector ukf: it is defined per scalar measurement"
        facts.add(_place(chosen, "robust"), text, "write `covariance: ud` and `sequential: true`")
    for key, given in (("gain_limit", chosen.gain_limit is not None), ("consider", bool(chosen.consider))):
        if not given or chosen.type == "ukf" or chosen.update == "joseph":
            continue
        form = f"`update: {chosen.update}`" if chosen.update else f"`covariance: {chosen.covariance}`"
        text = f"`{key}` does not go with {form}: with a changed gain only the joseph form is right"
        hint = "write `update: joseph`" + ("" if chosen.update else " and `covariance: ud` or `full`")
        facts.add(_place(chosen, key), text, hint)
    if chosen.gain == "steady":
        for key in ("robust", "adaptive", "adapt_R", "adapt_Q"):
            if getattr(chosen, key) is not None:
                text = f"`{key}` does not go with `gain: steady`: it makes the gain vary"
                facts.add(_place(chosen, key), text, "remove one of the two")
        for key in ("variance_floor", "variance_ceiling"):
            if getattr(chosen, key):
                text = f"`{key}` does not go with `gain: steady`: no covariance is kept"
                facts.add(_place(chosen, key), text, "remove one of the two")
    points = chosen.sigma_points
    if points is not None and points.kind == "cubature" and chosen.reject is not None:
        text = "`reject` does not go with cubature: it has no centre point to replace others by"
        facts.add(_place(chosen, "reject"), text, "choose other sigma points, or remove `reject`")


def _own(facts: Facts, chosen: Filter, sensor: Sensor) -> None:
    """What a sensor asks for in place of the filter's options."""
    for key, option in sensor.own.items():
        if option is None:
            continue
        at = facts.at(f"{sensor.place.path}.{key}", otherwise=sensor.place)
        if chosen.type == "iekf":
            text = f"`{key}` does not go with an iekf: it is defined per scalar measurement"
            facts.add(at, text, "remove one of the two")
        elif key == "robust" and chosen.type == "ukf" and not chosen.sequential:
            text = "`robust` does not go with a whole-vector ukf: it is defined per scalar measurement"
            facts.add(at, text, "write `covariance: ud` and `sequential: true`")
        elif chosen.gain == "steady":
            facts.add(at, f"`{key}` does not go with `gain: steady`: it makes the gain vary", "remove one of the two")


def _consider(facts: Facts, model: Model) -> None:
    chosen = model.filter
    if len(set(chosen.consider)) < len(chosen.consider):
        facts.add(_place(chosen, "consider"), "a state stands twice in `consider`", "name each once")
    elif model.states and set(chosen.consider) >= set(model.errors):
        facts.add(_place(chosen, "consider"), "no state is left to be estimated", "leave a state out of `consider`")
    elif facts.empty(f"{chosen.place.path}.consider"):
        facts.add(_place(chosen, "consider"), "`consider` names no state", "name a state, or remove the key")


# --- kf


def _variables(model: Model, sensor: Sensor | None = None) -> frozenset[str]:
    noises = model.noise if sensor is None else sensor.noise
    return frozenset(s.name for s in model.states) | frozenset(n.name for n in noises)


def _unknown(model: Model, expression: Expression) -> bool:
    """Whether a mistake in its names has been reported, so that nothing more can be said."""
    names = model.context.uses(expression)
    return expression.tree == BAD or any(model.context.kind_of(n) is None for n in names)


def _known(facts: Facts, model: Model) -> dict[str, Value]:
    return {**facts.known(model.context), **facts.folded}


def _guilty(model: Model, expression: Expression, variables: frozenset[str]) -> str:
    """The variables in which a formula is not linear, or which multiply each other."""
    found = []
    for name in sorted(variables & set(model.context.uses(expression))):
        form = Affine(model.context, frozenset({name})).form(expression.tree)
        if not form.affine or form.coefficients & variables:
            found.append(short(name))
    return ", ".join(found) or "states and noises"


def _linear(facts: Facts, model: Model) -> None:
    hint = "choose `type: ekf`"
    variables = _variables(model)
    affine = Affine(model.context, variables)
    for name, expression in model.dynamics.f.items():
        if not _unknown(model, expression) and not affine.is_affine(expression.tree, _known(facts, model)):
            facts.add(
                expression.place,
                f"f of {short(name)} is not linear in {_guilty(model, expression, variables)}, as a kf wants it",
                hint,
            )
    for sensor in model.measurements:
        variables = _variables(model, sensor)
        affine = Affine(model.context, variables)
        for component in sensor.components:
            h = component.h
            if not _unknown(model, h) and not affine.is_affine(h.tree, _known(facts, model)):
                guilty = _guilty(model, h, variables)
                text = f"h of {short(component.name)} is not linear in {guilty}, as a kf wants it"
                facts.add(h.place, text, hint)


def _steady(facts: Facts, model: Model) -> None:
    """F, H, Q, R and the noises' variances must be constant."""
    place = _place(model.filter, "gain")
    if facts.spec.dt is not None and facts.spec.dt.run_time:
        facts.add(place, "`gain: steady` does not go with a run-time dt: the gain would vary", "write `dt: 0.1`")
        return
    for name, expression in model.dynamics.f.items():
        _constant_coefficients(facts, model, expression, None, f"f of {short(name)}")
    _constant(facts, model, _entries(model.dynamics.Q), "gain: steady", "Q")
    noises = [n.variance for n in model.noise if n.variance] + _entries(model.noise_covariance or ())
    _constant(facts, model, noises, "gain: steady", "a noise")
    for sensor in model.measurements:
        for component in sensor.components:
            _constant_coefficients(facts, model, component.h, sensor, f"h of {short(component.name)}")
        _constant(facts, model, _measurement_noise(sensor), "gain: steady", "R")
        if sensor.partial:
            at = facts.at(f"{sensor.place.path}.partial", otherwise=sensor.place)
            text = "`partial` does not go with `gain: steady`: the gain depends on which components are used"
            facts.add(at, text, "remove one of the two")


def _constant_coefficients(
    facts: Facts, model: Model, expression: Expression, sensor: Sensor | None, what: str
) -> None:
    if _unknown(model, expression):
        return
    form = Affine(model.context, _variables(model, sensor)).form(expression.tree)
    if not form.affine:
        return
    varying = _varying(model, form.coefficients)
    if varying:
        text = f"the coefficients of {what} vary with {varying}, but `gain: steady` wants them constant"
        facts.add(expression.place, text, "use constants, or remove `gain`")


def _varying(model: Model, names: frozenset[str]) -> str:
    fixed = model.context.spec.dt is not None and not model.context.spec.dt.run_time
    kinds = {model.context.kind_of(name) or name for name in names} - ({"dt"} if fixed else set())
    return " and ".join(_VARYING[kind] for kind in _VARYING if kind in kinds)


def _entries(matrix: object) -> list[Expression]:
    """The formulas of a matrix or of a diagonal."""
    if isinstance(matrix, dict):
        return list(matrix.values())
    return [entry for row in matrix for entry in row] if isinstance(matrix, tuple) else []


def _measurement_noise(sensor: Sensor) -> list[Expression]:
    found = [c.variance for c in sensor.components if c.variance is not None]
    found += [n.variance for n in sensor.noise if n.variance is not None]
    return found + _entries(sensor.R) + _entries(sensor.noise_covariance)


def _constant(facts: Facts, model: Model, entries: list[Expression], key: str, what: str, allowed: str = "") -> None:
    """One mistake per matrix, at the first entry that varies. allowed: a kind of name that may."""
    for entry in entries:
        uses = frozenset(name for name in model.context.uses(entry) if model.context.kinds.get(name, name) != allowed)
        varying = _varying(model, uses)
        if varying:
            facts.add(entry.place, f"{what} varies with {varying}, but `{key}` wants it constant", "use constants")
            return


def _adapted_Q(facts: Facts, model: Model) -> None:
    """Constant, or a constant times a run-time dt."""
    entries = _entries(model.dynamics.Q)
    dt = model.context.spec.dt
    if dt is None or not dt.run_time or not any("dt" in model.context.uses(entry) for entry in entries):
        _constant(facts, model, entries, "adapt_Q", "Q")
        return
    _constant(facts, model, entries, "adapt_Q", "Q", "dt")
    form = Affine(model.context, frozenset({"dt"}))
    for entry in entries:
        if entry.tree == BAD or not model.context.uses(entry) <= {"dt", *facts.known(model.context), *_lets(model)}:
            continue
        at = [_at(facts, model, entry, step) for step in (1, 2)]
        if None in at or not form.form(entry.tree).affine or at[1] != 2 * at[0]:
            text = f"{short(entry.text)} is no constant times dt, but `adapt_Q` learns variances per second"
            facts.add(entry.place, text, "write each entry of Q as a constant times dt, or all as constants")
            return


def _lets(model: Model) -> list[str]:
    return [definition.name for definition in model.context.let]


def _at(facts: Facts, model: Model, entry: Expression, step: int) -> Any:
    """The value of an entry at a step."""
    known = {**facts.constant, "dt": Fraction(step)}
    for definition in model.context.let:
        keep(known, definition.name, definition.value.tree)
    return facts.tree(entry.tree, known)


def _constant_R(facts: Facts, model: Model, sensor: Sensor) -> None:
    entries = [c.variance for c in sensor.components if c.variance is not None] + _entries(sensor.R)
    _constant(facts, model, entries, "adapt_R", f"R of {short(sensor.name)}", "parameter")
