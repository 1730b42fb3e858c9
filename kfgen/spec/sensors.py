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


def readings_of(spec: Spec) -> list[tuple[Sensor, slice]]:
    """Each sensor, and where its numbers stand where those of all sensors are in one row."""
    found, first = [], 0
    for sensor in spec.measurements:
        last = first + len(sensor.fields)
        found.append((sensor, slice(first, last)))
        first = last
    return found
