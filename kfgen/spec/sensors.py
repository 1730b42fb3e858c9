"""What a sensor has of its own among the options of the filter."""

from __future__ import annotations

from dataclasses import replace

from kfgen.spec.types import Filter, Sensor


def filter_of(chosen: Filter, sensor: Sensor) -> Filter:
    """The filter's options for the updates of one sensor."""
    if not sensor.own:
        return chosen
    return replace(chosen, **sensor.own)
