"""The arguments of an update, brought into the spec's order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kfgen.reference.dual import Vector
from kfgen.reference.sensor import SensorModel


def own_inputs(sensor: SensorModel, inputs: ArrayLike | Mapping[str, float] | None) -> Vector:
    """The sensor's own inputs in order. Raises TypeError, ValueError, KeyError where they do not fit."""
    if (inputs is None) == bool(sensor.own):
        what = f"takes inputs: {', '.join(sensor.own)}" if sensor.own else "has no inputs of its own"
        raise TypeError(f"sensor {sensor.name} {what}")
    if isinstance(inputs, Mapping):
        if set(inputs) != set(sensor.own):
            raise KeyError(f"sensor {sensor.name} takes inputs: {', '.join(sensor.own)}; not {', '.join(inputs)}")
        inputs = [inputs[name] for name in sensor.own]
    return np.array([] if inputs is None else inputs, dtype=np.float64).reshape(len(sensor.own))


def components_used(sensor: SensorModel, mask: int | Sequence[bool] | None) -> tuple[int, ...]:
    """The components that a mask selects; all without one."""
    if mask is None:
        return tuple(range(sensor.m))
    if not sensor.partial:
        raise TypeError(f"sensor {sensor.name} takes no mask")
    if isinstance(mask, int | np.integer):
        return tuple(i for i in range(sensor.m) if int(mask) >> i & 1)
    return tuple(i for i, bit in enumerate(mask) if bit)
