"""Advice on how wide the filter starts: beyond a float's reach, or around an angle's circle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from kfgen.advice.track import Track
from kfgen.errors import Advice, Place
from kfgen.reference.sigma_points import SigmaRule
from kfgen.scalar_names import FLOAT
from kfgen.spec.problems import short
from kfgen.spec.types import Sensor, Spec

REACH = 2.0**24  # of a float: a variance that an update makes smaller by more is all round-off


def advice(spec: Spec, tracks: Sequence[Track]) -> Iterator[Advice]:
    for track in tracks:
        if spec.scalar == FLOAT and track.spec.filter.covariance == "full":
            yield from _precision(track)
        if track.spec.filter.type == "ukf":
            yield from _angles(track)


def _precision(track: Track) -> Iterator[Advice]:
    for sensor in track.spec.measurements:
        H, R = track.H[sensor.name][0], track.R[sensor.name]
        ratios = np.array([h @ track.model.P0 @ h / r if r > 0 else 0.0 for h, r in zip(H, np.diag(R), strict=True)])
        i = int(np.argmax(ratios))
        if ratios[i] > REACH:
            text = (
                f"the first update makes a variance {ratios[i]:.0e} times smaller, and float resolves {REACH:.0e}: "
                "`covariance: full` keeps little of it but round-off"
            )
            cure = "choose `covariance: ud` or `sqrt`, or `scalar: double`, or start with smaller variances"
            yield Advice(_places(sensor)[sensor.errors[i]], text, cure, "precision")


def _places(sensor: Sensor) -> dict[str, Place]:
    """Where a sensor says how well it measures."""
    places = {c.name: c.place if c.variance is None else c.variance.place for c in sensor.components}
    return places | {name: rotation.place for rotation in sensor.rotations for name in rotation.errors}


def _angles(track: Track) -> Iterator[Advice]:
    points = track.spec.filter.sigma_points
    if points is None:
        return
    reach = float(np.abs(SigmaRule(track.model).points(track.model.n).offsets).max())
    for state in track.spec.states:
        if state.kind != "angle":
            continue
        i = track.model.row[state.name]
        std = math.sqrt(max(float(track.model.P0[i, i]), 0.0))
        if reach * std <= math.pi:
            continue
        place = state.variance.place if state.variance is not None else state.place
        text = f"the sigma points of {short(state.name)} lie {reach * std:.2g} rad from the mean, more than half a turn"
        cure = f"choose a smaller alpha, or a std of at most {math.pi / reach:.2g}"
        yield Advice(place, text, cure, "sigma_angle")
