"""specs/ahrs.yaml over a minute of an inertial unit that lies, is turned about by hand, and is put back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kfgen import Status


@pytest.fixture(scope="module")
def kf(build):
    return build("ahrs")


@pytest.fixture(scope="module")
def log(kf, recorded):
    return recorded(kf, "imu")


@pytest.fixture(scope="module")
def result(kf, log):
    kf.init()
    return kf.run(log)


def up(q):
    """The earth's up axis in the sensor's frame [rows, 3]."""
    q0, q1, q2, q3 = (q / np.linalg.norm(q, axis=1)[:, None]).T
    return np.column_stack([2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), q0**2 - q1**2 - q2**2 + q3**2])


def apart(a, b):
    """The angle between attitudes in degrees [rows]."""
    cosine = np.abs(np.sum(a * b, axis=-1)) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    return np.degrees(2 * np.arccos(np.clip(cosine, -1, 1)))


def calm(log):
    """Rows within half a second of hardly any turning and acceleration."""
    rate = np.linalg.norm([log.columns[name] for name in ("gx", "gy", "gz")], axis=0)
    force = np.linalg.norm([log.columns[f"accel.{axis}"] for axis in "xyz"], axis=0)
    window = np.ones(50) / 50
    smooth = np.convolve(rate, window, "same") < 0.05
    return smooth & (np.convolve(np.abs(force - 9.75), window, "same") < 0.1)


def test_the_quaternion_keeps_its_length(result):
    length = np.linalg.norm(result.x[:, :4], axis=1)
    assert not result.counts(errors=True)
    assert np.all(np.abs(length - 1) < 0.005)  # measured: 0.0017, right after the first updates
    assert np.all(np.abs(length[1000:] - 1) < 1e-4)  # measured: 6e-6


def test_down_is_where_the_accelerometer_feels_it(result, log):
    force = np.column_stack([log.columns[f"accel.{axis}"] for axis in "xyz"])
    cosine = np.sum(up(result.x[:, :4]) * force, axis=1) / np.linalg.norm(force, axis=1)
    tilt = np.degrees(np.arccos(np.clip(cosine, -1, 1)))[calm(log)]
    assert tilt.size > 2000
    assert tilt.mean() < 0.8  # measured: 0.39 degrees, 47 % of the log being calm
    assert np.percentile(tilt, 95) < 2  # measured: 0.99


def test_the_attitude_returns_to_the_start(result):
    """It was tilted by 60 and turned by 70 degrees both ways in between."""
    start, end = result.x[1000, :4], result.x[-1, :4]
    assert apart(start, end) < 3  # measured: 1.3 degrees, most of it heading
    assert np.max(apart(result.x[:, :4], start)) > 60


def test_the_gyro_bias_is_that_of_the_rest(result, log):
    rest = log.columns["t"] < 11
    for i, name in enumerate(("gx", "gy", "gz")):
        at_rest = log.columns[name][rest].mean()
        # measured: 0.3 mrad/s apart, 0.5 mrad/s of standard deviation
        assert abs(result.x[np.flatnonzero(rest)[-1], 4 + i] - at_rest) < 0.001
    assert np.all(np.abs(result.x[2000:, 4:]) < 0.01)  # measured: 0.0042
    assert np.all(np.sqrt(result.var[-1, 4:]) < 0.001)


def test_accepted_updates_are_consistent(result):
    for sensor, low, high in (("accel", 0.05, 0.8), ("mag", 0.02, 0.5)):
        status = result.calls[f"update_{sensor}"]
        nis = result.nis[sensor][status == 0] / 3
        assert low < nis.mean() < high  # measured: 0.32 and 0.11: room for motion
        assert np.count_nonzero(status & Status.GATED) < 0.05 * status.size  # measured: 121, 7


@pytest.mark.parametrize(
    ("axis", "degrees"), [("x", 60), ("x", 180), ("y", 115), ("z", 60), ("z", -90)], ids=lambda value: str(value)
)
def test_finds_the_attitude_from_a_wrong_start(kf, log, result, axis, degrees):
    columns = {name: column[:1000] for name, column in log.columns.items()}
    kf.init()
    x = kf.x
    half = math.radians(degrees) / 2
    x[:4] = [math.cos(half), *(math.sin(half) * (axis == each) for each in "xyz")]
    kf.set_state(x)
    found = kf.run(columns)
    # measured: within 2 degrees after 0.05 to 1.4 s
    assert np.all(apart(found.x[300:, :4], result.x[300:1000, :4]) < 3)


def test_float_is_enough(build, log, result):
    exact = build("ahrs", scalar="double").run(log)
    assert np.max(np.abs(exact.x - result.x)) < 1e-4  # measured: 2e-6
