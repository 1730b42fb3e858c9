"""A step of a filter in phases, so that a bank can take the filters of its modes through them side by side.

A step is a generator. It yields `Judged` where a gate decides over the measurement, if it has to decide before all is
computed, and `Made` where everything is computed and guarded; what it does after that are its stores.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from kfgen.filters.base import DT, INPUTS, KF, MASK, sensor_argument
from kfgen.filters.frame import guards
from kfgen.filters.steps import process
from kfgen.filters.steps.first import First
from kfgen.filters.steps.gate import tested
from kfgen.filters.steps.needed import needed, read
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.sensor import needs_inputs
from kfgen.ir.program import Argument
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel


@dataclass(frozen=True)
class Judged:
    """The normalised innovation squared of the plain update."""

    nis: Value


@dataclass(frozen=True)
class Made:
    """The estimate that will be stored: x (n,) in the spec's order, P as its form holds it; of an update also the
    plain nis and the log-likelihood."""

    x: list[Value]
    P: Any
    nis: Value | None = None
    log_likelihood: Value | None = None


Phases = Generator[Judged | Made, None, None]


def begin_predict(t: Trace, model: Model, first: First) -> tuple[list[Argument], Step]:
    """The arguments of a prediction, tested."""
    first.wait(t)
    arguments: list[Argument] = [KF]
    if model.inputs:
        arguments.append(INPUTS)
    guards.arguments(t)
    if model.dt is None and model.spec.dt is not None:
        arguments.append(DT)
    return arguments, process.step_length(t, model)


def predict_doc(model: Model) -> str:
    length = "a step of dt" if model.dt is None else f"one step of {float(model.dt):.6g} s"
    if model.spec.dt is None:
        length = "one step"
    return f"Advance the estimate by {length}."


def begin_update(
    t: Trace, models: list[Model], sensors: list[SensorModel], partial: bool, first: First
) -> tuple[list[Argument], list[Value] | None]:
    """The arguments of an update of one sensor, as one model or several have it, tested; and whether each component
    counts, where a mask tells."""
    arguments: list[Argument] = [KF, sensor_argument(sensors[0].name)]
    used: list[Value] | None = None
    if partial:
        used = [t.bit("mask", i) for i in range(len(sensors[0].h))]
        some = used[0]
        for bit in used[1:]:
            some = some | bit
        t.guard(~some, "OK")
    first.wait(t, sensors[0])
    pairs = zip(models, sensors, strict=True)
    if any(needs_inputs(model, sensor) for model, sensor in pairs) or first.takes_inputs(sensors[0]):
        arguments.append(INPUTS)
    guards.arguments(t, first.needed(t, sensors[0], used, needed(models, sensors, used), read(models, sensors)))
    tested(t, models[0], sensors)
    if partial:
        arguments.append(MASK)
    return arguments, used


def update_name(sensor: SensorModel, partial: bool) -> tuple[str, str]:
    """The name of an update, and its doc."""
    suffix, what = ("_masked", "the chosen components of a measurement") if partial else ("", "a measurement")
    return f"update_{sensor.name}{suffix}", f"Take {what} of {sensor.name} into account."
