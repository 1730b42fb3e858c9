"""What the first measurements of sensors set: variances that may be, where any are kept."""

from __future__ import annotations

from kfgen.spec.operations import less
from kfgen.spec.rules.facts import Facts, show


def check(facts: Facts) -> None:
    for rule in facts.spec.initialize:
        for variance in rule.variance.values():
            number = facts.value(variance)
            if number is not None and less(number, 0):
                facts.add(variance.place, f"the variance {show(number)} is negative", "write a variance >= 0")
        if rule.variance and facts.spec.filter.gain is not None:
            place = next(iter(rule.variance.values())).place
            facts.add(place, "a filter with `gain: steady` keeps no variances", "remove `var`, or `gain`")
