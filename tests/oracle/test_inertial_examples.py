"""An inertial unit with GNSS, simulated, and one alone, recorded: specs of few lines through the reference."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import kfgen
from kfgen.simulate import simulate
from kfgen.spec.types import Filter
from tests.oracle.error_state import compose, exp, inverse, log, matrix

ROOT = Path(__file__).parents[2]
RECORDED = ROOT.parent / "shared" / "data" / "imu.csv"

EKF = Filter("ekf", "full", "joseph")
ITERATED = Filter("iekf", "full", "joseph", iterations=4)


@cache
def inertial():
    """specs/ins.yaml, begun with its initial attitude, whatever that is worth."""
    return replace(kfgen.load(ROOT / "specs" / "ins.yaml"), initialize=(), filter=ITERATED)


@cache
def tracks():
    """Logs with truth, whose attitude starts 0.5 rad off about each axis."""
    return [simulate(inertial(), 150, seed=seed, every={"gnss": 10, "mag": 2}).columns for seed in range(6)]


def errors(chosen=ITERATED, reset=True):
    """The mean of the normalised error squared per degree of freedom, row by row."""
    spec = inertial()
    spec = replace(spec, filter=chosen, rotations=tuple(replace(r, reset=reset) for r in spec.rotations))
    kf, found = kfgen.reference(spec), []
    for columns in tracks():
        kf.init()
        for k in range(len(columns["t"])):
            u = [columns[name][k] for name in kf.model.inputs]
            assert kf.predict(u) == 0
            for name, sensor in kf.sensors.items():
                z = np.array([columns[f"{name}.{component}"][k] for component in sensor.components])
                if np.isfinite(z).all():
                    assert kf.update(name, z, u if sensor.takes_inputs else None) == 0
            e = kf.model.space.difference(np.array([columns[f"true.{name}"][k] for name in kf.model.states]), kf.x)
            found.append(e @ np.linalg.solve(kf.P, e) / 15)
    return np.mean(np.reshape(found, (-1, 150)), axis=0)


def test_ins_is_consistent_from_a_start_half_a_radian_off():
    """Six runs of 15 degrees of freedom each: the band is 1 +- 3 sqrt(2 / 90)."""
    nees = errors()
    assert np.all(np.abs(nees[9:] - 1) < 0.45)  # measured: 1.00 after 0.1 s, 0.90 after 1.5 s


@pytest.mark.parametrize(("reset", "low", "high"), [(True, 2.0, 4.0), (False, 3.5, 6.0)])
def test_ins_without_iterations_believes_too_much(reset, low, high):
    nees = errors(EKF, reset)
    assert low < nees[9] < high  # measured: 2.7, without reset 4.1
    assert nees[-1] > 1.2  # measured: 1.3, 2.2


def recorded(turn=None):
    """t, u, accel, mag of a hand-held unit, as one mounted otherwise would have it: turned by a rotation vector."""
    if not RECORDED.is_file():
        pytest.skip("the recorded logs are not beside the repository")
    with RECORDED.open() as lines:
        rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(lines))[1:]])
    R = np.eye(3) if turn is None else matrix(exp(np.array(turn, float)))
    return rows[:, 0], *(rows[:, i : i + 3] @ R.T for i in (1, 4, 7))


def attitudes(log, rows, first=True):
    """The attitude row by row [rows, 4]. first: begin with a reading of both."""
    kf = kfgen.reference(kfgen.load(ROOT / "specs" / "ahrs.yaml"))
    t, u, accel, mag = log
    if first:
        assert kf.update("start", [*accel[0], *mag[0]]) == 0
    found = []
    for k in range(rows):
        if k:
            assert kf.predict(u[k], t[k] - t[k - 1]) < 256
        assert kf.update("accel", accel[k]) < 256
        assert kf.update("mag", mag[k]) < 256
        found.append(kf.x)
    return np.array(found)[:, :4], kf


def apart(a, b):
    return math.degrees(np.linalg.norm(log(compose(inverse(a), b))))


def test_ahrs_returns_to_where_it_lay():
    """A minute at 25 Hz, in which it was tilted by 60 and turned by 70 degrees both ways; at rest it feels up."""
    log = tuple(each[: len(each) // 4 * 4].reshape(-1, 4, *each.shape[1:]).mean(axis=1) for each in recorded())
    q, kf = attitudes(log, len(log[0]))
    assert apart(q[250], q[-1]) < 3  # measured: 1.3
    assert max(apart(q[250], each) for each in q[::5]) > 60
    assert np.allclose(np.linalg.norm(q, axis=1), 1, rtol=0, atol=1e-15)
    rest = log[0] < 11
    tilt = [math.acos(matrix(each)[2] @ force / np.linalg.norm(force)) for each, force in
            zip(q[rest], log[2][rest], strict=True)]  # fmt: skip
    assert math.degrees(np.mean(tilt)) < 0.8  # measured: 0.2
    assert np.all(np.sqrt(np.diag(kf.P))[3:] < 0.001)


@pytest.mark.parametrize("turn", [(math.pi, 0, 0), (0, 0, math.pi), (1, -2, 0.5), (0, 2, 2)])
def test_ahrs_comes_right_from_any_start(turn):
    """The unit mounted otherwise: its attitude is that of the other, from the first row on."""
    q = attitudes(recorded(), 60)[0]
    other = attitudes(recorded(turn), 60)[0]
    back = exp(np.array(turn, float))
    assert max(apart(compose(b, back), a) for a, b in zip(q, other, strict=True)) < 0.01
