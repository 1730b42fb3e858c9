"""The calls that come to nothing but a first estimate: those of `initialize`, and all that wait for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kfgen.spec.sensors import in_use
from kfgen.spec.tree import names
from kfgen.spec.types import Initialize, Spec


def firsts(
    spec: Spec, sensor: NDArray[np.int64], bits: NDArray[np.uint32], done: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of c calls in order: which set the first estimate [c], and which do nothing, since all wait for one [c].

    sensor [c]: -1 for a predict, else the index of the sensor; bits [c]: the components that were given; done [c]:
    whether the filter took it.
    """
    setting, waiting = np.zeros(len(sensor), bool), np.zeros(len(sensor), bool)
    awaited = {rule.sensor: rule for rule in spec.initialize}
    for c in range(len(sensor)):
        if not awaited:
            break
        held = any(rule.waits for rule in awaited.values())
        if sensor[c] >= 0:
            name = spec.measurements[sensor[c]].name
            if name in awaited and done[c] and _complete(spec, awaited[name], int(sensor[c]), int(bits[c])):
                setting[c] = True
                del awaited[name]
                continue
        waiting[c] = held
    return setting, waiting


def _complete(spec: Spec, rule: Initialize, sensor: int, bits: int) -> bool:
    """Whether all components that a rule is made of are there."""
    whole = spec.measurements[sensor]
    there = {whole.components[i].name for i in in_use(whole, bits)}
    formulas = [*rule.states.values(), *rule.variance.values(), *(each.value for each in rule.let)]
    needed = {name for formula in formulas for name in names(formula.tree)}
    return there >= needed & {component.name for component in whole.components}
