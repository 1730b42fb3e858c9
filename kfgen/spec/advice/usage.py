"""Advice on names: those that nothing uses, noises that do not act."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from kfgen.errors import Advice, Place
from kfgen.spec.constants import NotConstant, environment_of, value
from kfgen.spec.modes import mode_specs
from kfgen.spec.operations import NoValue
from kfgen.spec.parts import expressions
from kfgen.spec.problems import short
from kfgen.spec.tree import Expression, names
from kfgen.spec.types import Definition, Group, Spec


def advice(spec: Spec) -> Iterator[Advice]:
    yield from _unused(spec)
    yield from _crowded(spec)
    for mode in mode_specs(spec):
        yield from _noises(mode)
        if not _driven(mode):
            text = "no process noise acts on any state: the filter becomes sure of them, and deaf"
            cure = "write what may disturb them, `Q: {...}` or `noise`; or keep it awake with `variance_floor`"
            yield Advice(mode.dynamics.place, text, cure, "no_process_noise")


def closure(used: Iterable[str], let: tuple[Definition, ...]) -> set[str]:
    """Names, and those that they rest on through definitions."""
    found = set(used)
    for definition in reversed(let):  # each uses only those before it
        if definition.name in found:
            found |= set(names(definition.value.tree))
    return found


def _unused(spec: Spec) -> Iterator[Advice]:
    used = {name for expression in expressions(spec) for name in names(expression.tree)}
    modes = mode_specs(spec)
    declared: list[tuple[str, str, Place]] = [("constant", c.name, c.value.place) for c in spec.constants]
    declared += [("parameter", p.name, p.value.place) for p in spec.parameters]
    declared += [("input", i.name, i.place) for i in spec.inputs]
    declared += [("definition", d.name, d.value.place) for mode in modes for d in mode.let]
    whole = Whole(spec.groups)
    for kind, name, place in declared:
        if not whole.parts(name) & used:
            text = f"nothing uses the {kind} {short(whole.name(name))}"
            yield Advice(place, text, "use it, or remove it", "unused")
    yield from _unused_inputs(spec, modes)


def _unused_inputs(spec: Spec, modes: list[Spec]) -> Iterator[Advice]:
    """Inputs of sensors that stand in none of their formulas."""
    for sensor in spec.measurements:
        own = [s for mode in modes for s in mode.measurements if s.name == sensor.name]
        rules = [rule for rule in spec.initialize if rule.sensor == sensor.name]
        used = {name for part in (*own, *rules) for e in expressions(part) for name in names(e.tree)}
        whole = Whole(sensor.groups)
        for given in sensor.inputs:
            if not whole.parts(given.name) & used:
                text = f"nothing uses the input {short(whole.name(given.name))} of {short(sensor.name)}"
                yield Advice(given.place, text, "use it in h, R or gate, or remove it", "unused")


class Whole:
    """Which vector a part belongs to."""

    def __init__(self, groups: tuple[Group, ...]) -> None:
        self.groups = {part: group for group in groups for part in group.parts}

    def name(self, part: str) -> str:
        return self.groups[part].name if part in self.groups else part

    def parts(self, name: str) -> set[str]:
        """The parts of the vector of a part, itself where it is of none."""
        return set(self.groups[name].parts) if name in self.groups else {name}


def _crowded(spec: Spec) -> Iterator[Advice]:
    """A history that keeps fewer measurements of a step than its sensors may bring."""
    history = spec.history
    if history is None:
        return
    known = environment_of(spec, folded=False)
    rates = {s.name: 1.0 if s.rate is None else float(value(s.rate.tree, known)) for s in spec.measurements}
    total = math.ceil(sum(max(rate, 1.0) for rate in rates.values()))
    if total > history.per_step:
        often = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
        text = f"{total} measurements may belong to one step ({often}), but {history.per_step} are kept of it"
        at = history.places.get("per_step", history.place)
        yield Advice(at, text, f"write `per_step: {total}`: what comes beyond is TOO_OLD", "per_step")


def _noises(mode: Spec) -> Iterator[Advice]:
    acting = _names(mode.dynamics.f.values(), mode.let)
    whole = Whole(mode.groups)
    for noise in mode.noise:
        if not whole.parts(noise.name) & acting:
            text = f"the noise {short(whole.name(noise.name))} does not stand in `dynamics.f`, so it does nothing"
            yield Advice(noise.place, text, "write it into f, where it acts; or as a variance into Q", "unused_noise")
    for sensor in mode.measurements:
        seen = _names([component.h for component in sensor.components], mode.let)
        whole = Whole(sensor.groups)
        for noise in sensor.noise:
            if not whole.parts(noise.name) & seen:
                name = short(whole.name(noise.name))
                text = f"the noise {name} stands in no h of {short(sensor.name)}, so it does nothing"
                yield Advice(noise.place, text, "write it into h, or as `std` of a component", "unused_noise")


def _names(formulas: Iterable[Expression], let: tuple[Definition, ...]) -> set[str]:
    return closure((name for formula in formulas for name in names(formula.tree)), let)


def _driven(mode: Spec) -> bool:
    """Whether anything keeps the covariance from falling for ever."""
    known = environment_of(mode, folded=False)  # a parameter may be changed

    def some(formula: Expression | None) -> bool:
        if formula is None:
            return True
        try:
            return bool(value(formula.tree, known) != 0)
        except (NotConstant, NoValue):
            return True  # it depends on what only the run knows

    if mode.filter.variance_floor or mode.filter.adapt_Q is not None or mode.filter.adaptive is not None:
        return True
    acting = _names(mode.dynamics.f.values(), mode.let)
    Q = mode.dynamics.Q
    entries = Q.values() if isinstance(Q, Mapping) else [entry for row in Q for entry in row]
    return any(map(some, entries)) or any(noise.name in acting and some(noise.variance) for noise in mode.noise)
