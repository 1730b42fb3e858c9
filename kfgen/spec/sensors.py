"""What a sensor has of its own: options of the filter, and the numbers that come with a measurement."""

from __future__ import annotations

from dataclasses import replace

from kfgen.spec.types import Filter, Sensor, Spec


def filter_of(chosen: Filter, sensor: Sensor) -> Filter:
    """The filter's options for the updates of one sensor."""
    if not sensor.own:
        return chosen
    return replace(chosen, **sensor.own)


def columns_of(sensor: Sensor) -> list[str]:
    """The columns of a log that hold the numbers of a measurement."""
    return [f"{sensor.name}.{each.name}" for each in sensor.fields]


AGE, TIME = "age", "time"
"""What a column of a log says of a reading beside its numbers, in s: how late it is, or when it was made."""


def tells(sensor: Sensor, word: str) -> bool:
    """Whether the column `<sensor>.<word>` tells of lateness: a sensor may have a component of that name."""
    return word not in {each.name for each in sensor.fields}


def late_columns(spec: Spec) -> list[str]:
    """The columns that a log of a filter that takes late measurements may have beside those that it needs."""
    if spec.history is None:
        return []
    return [f"{s.name}.{word}" for s in spec.measurements for word in (AGE, TIME) if tells(s, word)]


def readings_of(spec: Spec) -> list[tuple[Sensor, slice]]:
    """Each sensor, and where its numbers stand where those of all sensors are in one row."""
    found, first = [], 0
    for sensor in spec.measurements:
        last = first + len(sensor.fields)
        found.append((sensor, slice(first, last)))
        first = last
    return found


def in_use(sensor: Sensor, bits: int) -> tuple[int, ...]:
    """The components (indices) of which a reading counts where those in a mask are there: a quaternion counts whole, or
    not at all."""
    there = {component.name for i, component in enumerate(sensor.components) if bits >> i & 1}
    for rotation in sensor.rotations:
        if not there.issuperset(rotation.parts):
            there -= set(rotation.parts)
    return tuple(i for i, component in enumerate(sensor.components) if component.name in there)


def degrees_of(sensor: Sensor, bits: int) -> int:
    """The degrees of freedom of a reading of the components in a mask."""
    used = in_use(sensor, bits)
    names = {sensor.components[i].name for i in used}
    return len(used) - sum(names.issuperset(rotation.parts) for rotation in sensor.rotations)
