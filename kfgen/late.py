"""Measurements that arrive late, in logs: the columns `<sensor>.age` (s) and `<sensor>.time` (s, when it was made).

A row holds what arrived in it; without such a column, or where its cell is empty, what it holds is of its own time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.logs import Log
from kfgen.spec.sensors import AGE, TIME, columns_of, tells
from kfgen.spec.types import Sensor, Spec

Array = NDArray[np.float64]
_SAME = 1e-6  # of a step: times that differ by less are one


def made_at(spec: Spec, log: Log, t: Array) -> dict[str, Array]:
    """When the reading of each row was made [rows], in s, of the sensors of which the log says so; t: [rows].

    KfgenError for a sensor with both columns.
    """
    found = {}
    for sensor in spec.measurements:
        age, time = (log.columns.get(f"{sensor.name}.{word}") for word in (AGE, TIME))
        if age is not None and time is not None and tells(sensor, AGE) and tells(sensor, TIME):
            raise KfgenError(f"{log.source}: `{sensor.name}` has both `.age` and `.time`; one of them is enough")
        if age is not None and tells(sensor, AGE):
            found[sensor.name] = np.where(np.isnan(age), t, t - age)
        elif time is not None and tells(sensor, TIME):
            found[sensor.name] = np.where(np.isnan(time), t, time)
    return found


def ages(spec: Spec, log: Log, t: Array, step: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """How many predictions ago each reading was made [rows, sensors]: to the nearest of the times of the steps.

    t: [rows] s. step: [rows], whether a row is predicted. The filter starts at the time of the first row where that is
    not predicted, else a step before it; what was made earlier is older than all steps.
    """
    found = np.zeros((len(t), len(spec.measurements)), dtype=np.uint32)
    times = made_at(spec, log, t)
    if not times or not len(t):
        return found
    predicted = step != 0
    start = t[0] - _usual(t) * predicted[0]
    stepped = np.concatenate([[start], t[predicted]])  # the time of each step
    now = np.cumsum(predicted)
    for i, sensor in enumerate(spec.measurements):
        if sensor.name in times:
            made = times[sensor.name]
            age = np.maximum(now - _nearest(stepped, made), 0)
            found[:, i] = np.where(made < start - 0.5 * _usual(t), now + 1, age)
    return found


def _nearest(times: Array, wanted: Array) -> NDArray[np.intp]:
    """The index of the time nearest to each of some; of two that are equally near the later."""
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    if len(times) == 1:
        return np.zeros(len(wanted), dtype=np.intp)
    before = after - 1
    nearer = times[after] - wanted <= (wanted - times[before]) * (1 + _SAME)
    return np.where(nearer, after, before)


def _usual(t: Array) -> float:
    """The usual step; 0 without any."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def delayed(spec: Spec, log: Log, delays: Mapping[str, float]) -> Log:
    """The log as it would have been recorded if the readings of some sensors arrived so many s late.

    Each stands in the first row at or after that time that has none yet, its age in `<sensor>.age`; what would arrive
    after the end is lost. KfgenError for an unknown sensor, or a delay that is negative.
    """
    columns = dict(log.columns)
    t = columns["t"]
    same = _SAME * _usual(t)
    for name, delay in delays.items():
        sensor = _sensor(spec.measurements, name)
        if not 0 <= delay < float("inf"):
            raise KfgenError(f"a delay of `{name}` of {delay:g} s is not possible")
        if not tells(sensor, AGE):
            raise KfgenError(f"`{name}` has a component `{AGE}`, so a log cannot tell how late it is")
        names = columns_of(sensor)
        readings = np.column_stack([columns[each] for each in names])
        late = np.full_like(readings, np.nan)
        age = np.full(len(t), np.nan)
        free = 0
        for row in np.flatnonzero(~np.isnan(readings).all(axis=1)):
            free = max(free, int(np.searchsorted(t, t[row] + delay - same)))
            if free == len(t):
                break
            late[free], age[free] = readings[row], t[free] - t[row]
            free += 1
        columns |= dict(zip(names, late.T, strict=True))
        columns[f"{name}.{AGE}"] = age
    return Log(columns, log.rows, log.source, log.ignored)


def _sensor(sensors: Sequence[Sensor], name: str) -> Sensor:
    for sensor in sensors:
        if sensor.name == name:
            return sensor
    known = ", ".join(sensor.name for sensor in sensors)
    raise KfgenError(f"unknown sensor `{name}` (known: {known})")
