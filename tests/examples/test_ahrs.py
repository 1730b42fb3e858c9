"""specs/ahrs.yaml over a minute of an inertial unit that lies, is turned about by hand, and is put back; and beside the
filter of ahrs_plain.yaml, whose quaternion is four plain states."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kfgen
from kfgen.status import ERROR, Status
from tests.examples.conftest import ROOT
from tests.oracle.error_state import compose, exp, inverse, matrix
from tests.oracle.error_state import log as vector_of


@pytest.fixture(scope="module")
def kf(build):
    return build("ahrs")


@pytest.fixture(scope="module")
def log(plain, recorded):
    return recorded(plain, "imu")


@pytest.fixture(scope="module")
def plain():
    """The quaternion as four plain states."""
    return kfgen.compile(ROOT / "tests" / "examples" / "ahrs_plain.yaml")


def begun(columns, turn=None):
    """The log with its first row as `start`; as a unit mounted otherwise would have it, turned by a rotation vector."""
    R = np.eye(3) if turn is None else matrix(exp(np.array(turn, float)))
    out = {"t": columns["t"]}
    for names in (("gx", "gy", "gz"), *([f"{sensor}.{axis}" for axis in "xyz"] for sensor in ("accel", "mag"))):
        out |= dict(zip(names, R @ [columns[name] for name in names], strict=True))
    for part, sensor in (("a", "accel"), ("b", "mag")):
        for axis in "xyz":
            out[f"start.{part}_{axis}"] = np.full(len(out["t"]), np.nan)
            out[f"start.{part}_{axis}"][0] = out[f"{sensor}.{axis}"][0]
    return out


@pytest.fixture(scope="module")
def result(kf, log):
    kf.init()
    return kf.run(begun(log.columns))


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
    assert np.all(np.abs(length - 1) < 1e-6)  # measured: 2e-7, a float's rounding


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


@pytest.mark.parametrize("turn", [(math.pi, 0, 0), (0, 0, math.pi), (1, -2, 0.5), (0, 2, 2), (0, 0, 0.1)], ids=str)
def test_comes_right_from_any_start(kf, log, result, turn):
    """The unit mounted otherwise: its attitude is that of the other, from the first row on."""
    columns = begun({name: column[:500] for name, column in log.columns.items()}, turn)
    kf.init()
    found = kf.run(columns)
    back = exp(np.array(turn, float))
    whole = np.array([compose(q, back) for q in found.x[:, :4]])
    assert np.all(apart(whole, result.x[:500, :4]) < 0.01)  # measured: 0.0002 degrees


def test_float_is_enough(build, log, result):
    exact = build("ahrs", scalar="double").run(begun(log.columns))
    assert np.max(np.abs(exact.x - result.x)) < 1e-4  # measured: 2e-6


def test_agrees_with_plain_states_on_the_log(plain, log, result):
    plain.init()
    other = plain.run(log)
    assert np.percentile(apart(other.x[500:, :4], result.x[500:, :4]), 99) < 0.1  # measured: 0.02 degrees


def simulated(seed, rows=300):
    """A unit that starts anywhere within the filters' initial spread and is turned about at up to 3 rad/s: truth
    [rows, 7], and readings [rows, 3] of gyro, accelerometer and magnetometer."""
    random = np.random.default_rng(seed)
    q, b = exp(0.3 * random.standard_normal(3)), 0.02 * random.standard_normal(3)
    phase, pace = random.uniform(0, 6.28, 3), random.uniform(1, 4, 3)
    truth, readings = [], []
    for k in range(rows):
        rate = np.array([2.0, 2.5, 3.0]) * np.sin(0.01 * k * pace + phase) if k else np.zeros(3)
        q = compose(q, exp(0.01 * rate))
        truth.append([*q, *b])
        seen = [matrix(q).T @ field for field in ([0, 0, 9.75], [15.4, 0, -40.8])]
        readings.append([rate + b + 0.03 * random.standard_normal(3), seen[0] + 0.3 * random.standard_normal(3),
                         seen[1] + 3 * random.standard_normal(3)])  # fmt: skip
    return np.array(truth), np.array(readings)


def followed(kf, run, first=False):
    """The errors of attitude (rad) and bias [rows, 6] and the normalised error squared per degree of freedom [rows].
    first: begin with a reading of both sensors; else with the filter's own attitude."""
    truth, readings = run
    kf.init()
    errors, nees = [], []
    for k, (gyro, accel, mag) in enumerate(readings):
        if k == 0 and first:
            assert kf.update("start", [*accel, *mag]) == 0
        else:
            assert kf.predict(gyro, 0.01) == 0
            assert kf.update("accel", accel) < ERROR
            assert kf.update("mag", mag) < ERROR
        x, P = kf.x, kf.P
        w, v = x[0], x[1:4]
        if len(P) == 7:  # of four numbers to the three of their error: 2 of q^-1 dq
            x[:4] /= np.linalg.norm(x[:4])
            skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
            E = np.zeros((6, 7))
            E[:3, :4], E[3:, 4:] = 2 * np.column_stack([-v, w * np.eye(3) - skew]), np.eye(3)
            P = E @ P @ E.T
        e = np.array([*vector_of(compose(inverse(x[:4]), truth[k, :4])), *(truth[k, 4:] - x[4:])])
        errors.append(e)
        nees.append(e @ np.linalg.solve(P, e) / 6)
    return np.array(errors), np.array(nees)


def test_is_as_sure_as_it_may_be(kf, plain):
    """20 runs of 6 degrees of freedom: the band is 1 +- 3 sqrt(2 / 120)."""
    runs = [simulated(seed) for seed in range(20)]
    own, other = [followed(kf, run, True) for run in runs], [followed(plain, run) for run in runs]
    nees = np.mean([each[1] for each in own], axis=0)
    assert np.all(np.abs(nees[[20, 100, 200, 299]] - 1) < 0.39)
    theirs = np.mean([each[1] for each in other], axis=0)
    assert np.max(nees[5:]) < 1.39 < np.max(theirs)  # measured: 1.2 and 2.7
    rms, plain_rms = (np.sqrt(np.mean([e[50:, :3] ** 2 for e, _ in each])) for each in (own, other))
    assert rms < 0.02  # rad; measured: 0.013
    assert rms < plain_rms  # measured: 0.036
