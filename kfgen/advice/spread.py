"""Advice on how wide the filter starts: beyond a float's reach, what robust updates believe, or around a circle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kfgen.advice.track import Array, Track
from kfgen.errors import Advice, Place
from kfgen.reference.carried import carried_by_process, carried_by_sensor, wrapped_by_process, wrapped_by_sensor
from kfgen.reference.model import Model
from kfgen.reference.sigma_points import SigmaRule
from kfgen.scalar_names import FLOAT
from kfgen.spec.advice.usage import closure
from kfgen.spec.problems import short
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import names
from kfgen.spec.types import Sensor, Spec

REACH = 2.0**24  # of a float: a variance that an update makes smaller by more is all round-off
GLITCH = 6.0  # sigma of R, from which on chernodarov and huber leave P alone


def advice(spec: Spec, tracks: Sequence[Track]) -> Iterator[Advice]:
    for track in tracks:
        if spec.scalar == FLOAT and track.spec.filter.covariance == "full":
            yield from _precision(track)
        yield from _robust(track)
        if track.spec.filter.type == "ukf":
            yield from _angles(track)


def _first(track: Track, sensor: Sensor) -> tuple[int, float]:
    """The component whose h is the least known against R at the first update, and H P0 H^T / R of it."""
    H, R = track.H[sensor.name][0], track.R[sensor.name]
    ratios = [float(h @ track.model.P0 @ h / r) if r > 0 else 0.0 for h, r in zip(H, np.diag(R), strict=True)]
    i = int(np.argmax(ratios))
    return i, ratios[i]


def _robust(track: Track) -> Iterator[Advice]:
    """A robust update normalises an innovation by the root of R alone: a wide start looks like an outlier."""
    if track.spec.initialize:
        return
    for sensor in track.spec.measurements:
        robust = filter_of(track.spec.filter, sensor).robust
        i, ratio = _first(track, sensor)
        if robust is None or robust.influence not in ("chernodarov", "huber") or ratio <= GLITCH**2:
            continue
        text = (
            f"the first innovation is expected at {np.sqrt(1 + ratio):.2g} deviations of R, and `robust` takes beyond "
            f"{GLITCH:.0f} for a glitch: x jumps, P does not fall"
        )
        cure = "start with `initialize`, with a smaller std of the states, or without robust"
        yield Advice(_places(sensor)[sensor.errors[i]], text, cure, "robust_start")


def _precision(track: Track) -> Iterator[Advice]:
    for sensor in track.spec.measurements:
        i, ratio = _first(track, sensor)
        if ratio > REACH:
            text = (
                f"the first update makes a variance {ratio:.0e} times smaller, and float resolves {REACH:.0e}: "
                "`covariance: full` keeps little of it but round-off"
            )
            cure = "choose `covariance: ud` or `sqrt`, or `scalar: double`, or start with smaller variances"
            yield Advice(_places(sensor)[sensor.errors[i]], text, cure, "precision")


def _places(sensor: Sensor) -> dict[str, Place]:
    """Where a sensor says how well it measures."""
    places = {c.name: c.place if c.variance is None else c.variance.place for c in sensor.components}
    return places | {name: rotation.place for rotation in sensor.rotations for name in rotation.errors}


def _angles(track: Track) -> Iterator[Advice]:
    """Images that are wrapped, since f or h is not linear, and of which some points would come round from behind."""
    model, spec = track.model, track.spec
    if spec.filter.sigma_points is None:
        return
    carried = len(carried_by_process(model))
    std = np.sqrt(np.maximum(np.diag(model.P0), 0.0))
    image = _deviations(track.F[0], model.P0)
    for i in wrapped_by_process(model):
        state, own = spec.states[i], spec.dynamics.f.get(spec.states[i].name)
        moved = own is not None and state.name in closure(names(own.tree), spec.let)
        place = state.variance.place if moved and state.variance is not None else own.place if own else state.place
        row = model.row[spec.states[i].name]
        reach = _reach(model, carried) * max(float(image[row]), float(std[row]) if moved else 0.0)
        yield from _beyond(reach, model.periods[i], f"of {short(state.name)}", "f", place, moved)
    for sensor in spec.measurements:
        seen, carried = _deviations(track.H[sensor.name][0], model.P0), len(carried_by_sensor(model, sensor))
        for i in wrapped_by_sensor(model, sensor):
            component = sensor.components[i]
            if component.period is not None:
                before = {each.name for each in sensor.components[:i]}
                row = i - sum(rotation.parts[0] in before for rotation in sensor.rotations)  # 3 errors of 4 numbers
                reach, what = _reach(model, carried) * float(seen[row]), f"seen as {short(component.name)}"
                yield from _beyond(reach, model.number(component.period), what, "its h", component.h.place, False)


def _reach(model: Model, carried: int) -> float:
    """How many standard deviations the points of a state lie from its mean."""
    rule = SigmaRule(model)
    return float(np.abs(rule.points(model.n if rule.own else model.n + carried).offsets).max())


def _deviations(J: Array, P: Array) -> Array:
    """Standard deviations of J x."""
    variances: Array = np.einsum("ij,jk,ik->i", J, P, J)
    return np.sqrt(np.maximum(variances, 0.0))


def _beyond(reach: float, period: float, what: str, formula: str, place: Place, own: bool) -> Iterator[Advice]:
    if reach <= period / 2:
        return
    text = (
        f"the sigma points {what} lie {reach:.2g} from the mean, more than half a turn ({period / 2:.3g}), and "
        f"{formula} is not linear: they are wrapped, and the variance is too small"
    )
    cure = "choose a smaller alpha, or a smaller std" if own else "choose a smaller alpha, or smaller deviations"
    yield Advice(place, text, cure, "sigma_angle")
