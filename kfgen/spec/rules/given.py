"""What comes with measurements: inputs of sensors, and what their first measurements set."""

from __future__ import annotations

from kfgen.spec.operations import less
from kfgen.spec.problems import short
from kfgen.spec.rules.facts import Facts, Model, show
from kfgen.spec.types import Initialize, Sensor


def check(facts: Facts) -> None:
    for model in facts.models():
        for sensor in model.measurements:
            _inputs(facts, sensor, model)
    met: set[str] = set()
    for rule in facts.spec.initialize:
        _first(facts, rule)
        if rule.sensor in met:
            facts.add(rule.place, f"the sensor {short(rule.sensor)} is named twice", "set all states in one entry")
        met.add(rule.sensor)


def _inputs(facts: Facts, sensor: Sensor, model: Model) -> None:
    for each in sensor.inputs:
        kind = model.context.kinds.get(each.name)
        if kind is not None:
            text = f"the name {short(each.name)} is already that of {'an' if kind[0] == 'i' else 'a'} {kind}"
            facts.add(each.place, text, "choose another one; those of other sensors may be the same")


def _first(facts: Facts, rule: Initialize) -> None:
    for variance in rule.variance.values():
        number = facts.value(variance)
        if number is not None and less(number, 0):
            facts.add(variance.place, f"the variance {show(number)} is negative", "write a variance >= 0")
    if rule.variance and facts.spec.filter.gain is not None:
        place = next(iter(rule.variance.values())).place
        facts.add(place, "a filter with `gain: steady` keeps no variances", "remove `var`, or `gain`")
