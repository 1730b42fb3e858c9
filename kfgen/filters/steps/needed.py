"""Under which mask an update needs an input or a parameter: that of a component left out may be anything."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from operator import or_
from typing import Any

from kfgen.ir.trace import Value
from kfgen.model import Model
from kfgen.model.model import SensorModel

Places = frozenset[int]


def needed(models: Sequence[Model], sensors: Sequence[SensorModel], used: Sequence[Value] | None) -> dict[str, Value]:
    """Path of an input or parameter -> whether it counts, for those that do not always. sensors: the sensor as each
    model has it; used: whether each component counts, where a mask tells."""
    if used is None:
        return {}
    found: dict[str, set[Places]] = {}
    for model, sensor in zip(models, sensors, strict=True):
        for places, formulas in _formulas(model, sensor):
            for name in model.uses(*formulas):
                found.setdefault(name, set()).add(places)
    paths = {name: f"u.{name}" for model in models for name in model.inputs}
    paths |= {name: f"kf.parameters.{name}" for model in models for name, _ in model.parameters}
    paths |= {name: f"z.{name}" for sensor in sensors for name in sensor.inputs}
    always = frozenset[int]()
    out: dict[str, Value] = {}
    for name, path in paths.items():
        every = found.get(name, {always})
        singles = {next(iter(places)) for places in every if len(places) == 1}
        if always in every or len(singles) == len(used):
            continue
        conditions = [used[i] for i in sorted(singles)]
        pairs = sorted(sorted(places) for places in every if not singles & places)
        conditions += [used[i] & used[j] for i, j in pairs]
        out[path] = reduce(or_, conditions)
    return out


def read(models: Sequence[Model], sensors: Sequence[SensorModel]) -> set[str]:
    """Names that an update itself evaluates."""
    pairs = zip(models, sensors, strict=True)
    return {n for model, sensor in pairs for _, formulas in _formulas(model, sensor) for n in model.uses(*formulas)}


def _formulas(model: Model, sensor: SensorModel) -> Iterable[tuple[Places, list[Any]]]:
    """What an update evaluates, and the components that have to be in use for it to count; none: always."""
    index = {w.name: k for k, w in enumerate(sensor.noises)}
    for i, h in enumerate(sensor.h):
        own = [h] if sensor.residual[i] is None else [h, sensor.residual[i]]
        noises = [index[name] for name in model.uses(h) if name in index]
        own += [entry for k in noises for entry in sensor.noise_covariance[k]]
        yield frozenset({i}), own
    if model.options.adapt_R is None:
        for i, row in enumerate(sensor.R):
            for j, entry in enumerate(row):
                yield frozenset({i, j}), [entry]
    if sensor.gate is not None and sensor.gate.threshold is not None:
        yield frozenset(), [sensor.gate.threshold]
    influence = model.options.influence
    if influence is not None and influence.psi is not None:
        yield frozenset(), [influence.psi, influence.slope]
