"""`<name>_selftest.c`: a filter that checks itself on the board, against a recorded run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from kfgen.emit.data import View
from kfgen.emit.render import render_c
from kfgen.emit.text import WIDTH
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.generate import Generated
from kfgen.ir.given import given
from kfgen.ir.program import walk
from kfgen.scalar_names import DOUBLE
from kfgen.scalars import SCALARS, Scalar
from kfgen.selftest.exact import record_exactly
from kfgen.selftest.record import Record, record
from kfgen.selftest.track import Track, track_of
from kfgen.spec.constants import value
from kfgen.spec.types import Spec

__all__ = ["selftest"]

ULPS = 16
"""Units in the last place of the largest |x| (and variance) that rounding may take, beside the tolerance."""


@dataclass(frozen=True)
class Array:
    """A static const array of reals."""

    name: str
    about: str
    size: int
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Update:
    """A sensor's update: the fields of its struct, where they stand in a step's readings; it comes in each `every`-th
    step."""

    name: str
    fields: tuple[str, ...]
    first: int
    every: int
    arguments: str
    tested: tuple[str, ...] = ()  # what it refuses where it is not finite: `z_gnss.x`, `u.gyro`


@dataclass(frozen=True)
class Nearness:
    """How near the numbers have to come, as literals."""

    part: str  # the tolerance, for the reader
    tolerance: str
    resolution: str
    square: str  # of the part of |x| that stands for a standard deviation where there is no covariance
    two: str
    small: tuple[str, str] | None  # tolerance and resolution where a double has four bytes


@dataclass(frozen=True)
class SelfTest:
    """What the template sees."""

    view: View
    command: str
    steps: int
    inputs: tuple[str, ...]
    sensors: tuple[Update, ...]
    readings: int
    predict: str
    has_dt: bool
    has_covariance: bool
    periods: tuple[tuple[str, str], ...]
    arrays: tuple[Array, ...]
    near: Nearness | None  # None: to the bit
    read: tuple[str, ...] = ()  # the inputs that a prediction reads
    outputs: tuple[str, ...] = ()


def selftest(spec: Spec, generated: Generated, track: Track | None = None) -> dict[str, str]:
    """{`<name>_selftest.c`: text}. Pure. Raises KfgenError where the model does not get through one step.

    track: what is replayed, in place of a short simulated run. In fixed point every number must come out to the bit.
    """
    track = track_of(spec) if track is None else track
    scalar: Scalar
    if spec.scalar in SCALARS:
        scalar, found = SCALARS[spec.scalar], record(spec, track)
    else:
        scalar = fixed = Fixed(spec.scalar, spec.fixed.rounding)
        found = record_exactly(spec, generated.code, fixed, generated.declarations, track)
    made = _view(spec, generated, scalar, found)
    return {f"{spec.name}_selftest.c": render_c("selftest/selftest.c.j2", s=made, v=made.view)}


def _view(spec: Spec, generated: Generated, scalar: Scalar, found: Record) -> SelfTest:
    declared = generated.declarations
    exact = found.statuses is not None
    track = found.track
    sensors: list[Update] = []
    first = 0
    for sensor in spec.measurements:
        takes_u = declared.takes(f"update_{sensor.name}", "u")
        names = tuple(each.name for each in sensor.fields)
        read = _read(generated, f"update_{sensor.name}")
        tested = [f"z_{sensor.name}.{component.name}" for component in sensor.components]
        tested += [f"z_{sensor.name}.{own.name}" for own in sensor.inputs if f"z.{own.name}" in read]
        tested += [f"u.{each.name}" for each in spec.inputs if f"u.{each.name}" in read]
        sensors.append(Update(sensor.name, names, first, 1 + len(sensors), ", &u" if takes_u else "", tuple(tested)))
        first += len(names)
    takes = [name for name in ("u", "dt") if declared.takes("predict", name)]
    uses_u = "u" in takes or any(each.arguments for each in sensors)
    arrays = [_array("readings", "all sensors' components, step by step", track.z.ravel(), scalar)]
    if uses_u:
        arrays.insert(0, _array("inputs", "u, step by step", track.u.ravel(), scalar))
    if "dt" in takes:
        arrays.insert(0, _array("steps", "dt", track.dt, scalar))
    arrays.append(_array("states", "x after each step", found.x.ravel(), scalar))
    if found.statuses is not None:
        arrays.append(_array("statuses", "the flags of each step's calls", found.statuses, scalar))
    else:
        arrays.append(_array("scale", "the largest |x| of each state", abs(found.x).max(axis=0), scalar))
    if found.variance is not None and not exact:
        largest = np.maximum(found.variance.max(axis=0), found.initial)
        arrays.append(_array("spread", "the largest variance of each state", largest, scalar))
    if found.variance is not None:
        arrays.append(_array("variances", "the diagonal of P after each step", found.variance.ravel(), scalar))
    if spec.outputs:
        arrays.append(_array("told", "the outputs after each step", found.outputs.ravel(), scalar))
        arrays.append(_array("deviations", "their standard deviations", found.deviations.ravel(), scalar))
        if not exact:
            arrays.append(_array("sizes", "the largest of each output", abs(found.outputs).max(axis=0), scalar))
            arrays.append(_array("wide", "and of their deviations", found.deviations.max(axis=0), scalar))
    kinds = [(state.name, state.period) for state in spec.states if not exact]
    periods = [
        (name, scalar.literal(Fraction(float(value(period.tree, spec)))))
        for name, period in kinds
        if period is not None
    ]
    return SelfTest(
        generated.view, f"{generated.view.command} --selftest", len(found.x), tuple(i.name for i in spec.inputs) if
        uses_u else (), tuple(sensors), first, "".join({"u": ", &u", "dt": ", dt"}[name] for name in takes),
        "dt" in takes, found.variance is not None, tuple(periods), tuple(arrays),
        None if exact else _nearness(spec, scalar, found.tolerance),
        tuple(each.name for each in spec.inputs if f"u.{each.name}" in _read(generated, "predict")),
        tuple(output.name for output in spec.outputs),
    )  # fmt: skip


def _read(generated: Generated, function: str) -> set[str]:
    """What a function of the filter reads of what it is given."""
    (body,) = [f.body for f in generated.code.functions if f.name == function]
    return given(walk(body))


def _nearness(spec: Spec, scalar: Scalar, tolerance: float) -> Nearness:
    return Nearness(
        f"{tolerance:g}", scalar.literal(Fraction(str(tolerance))), scalar.literal(ULPS * scalar.epsilon),
        scalar.literal(Fraction(1, 10000)), scalar.literal(Fraction(2)),
        ("1e-2", "2e-6") if spec.scalar == DOUBLE else None,
    )  # fmt: skip


def _array(name: str, about: str, numbers: Iterable[float], scalar: Scalar) -> Array:
    texts = [scalar.literal(Fraction(float(number))) for number in numbers]
    return Array(name, about, len(texts), tuple(_filled(texts)))


def _filled(texts: Iterable[str]) -> Iterable[str]:
    line = ""
    for text in texts:
        if line and len(line) + len(text) + 2 > WIDTH - 6:
            yield line + ","
            line = ""
        line += f", {text}" if line else text
    yield line
