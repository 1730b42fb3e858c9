"""Reports, tuning and smoothing of filters with rotations, vectors, first and late measurements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import kfgen
from kfgen import tune
from kfgen.apart import differences
from kfgen.errors import KfgenError
from kfgen.late import delayed
from kfgen.native.run import plan
from kfgen.native.settled import settled
from kfgen.native.trace import trace
from kfgen.reference import smooth
from kfgen.report.walk import Walker
from kfgen.simulate import simulate
from kfgen.smoothing import smoothed
from kfgen.spec import loads
from tests.oracle import inertial
from tests.oracle.error_state import Space, compose, derivative, exp, log

BOTH = pytest.mark.parametrize("error", ["body", "reference"])


def columns(rows):
    """The readings of the inertial problem as a log."""
    u, z, _ = zip(*inertial.readings(rows), strict=True)
    names = [f"{name}_{a}" for name in ("gyro", "accel") for a in "xyz"]
    found = dict(zip(names, np.array(u).T, strict=True))
    for sensor, parts in (("gnss", "p_x p_y p_z"), ("mag", "b_x b_y b_z"), ("star", "q_w q_x q_y q_z")):
        parts = parts.split()
        seen = np.array([each.get(sensor, np.full(len(parts), np.nan)) for each in z])
        found |= {f"{sensor}.{part}": seen[:, i] for i, part in enumerate(parts)}
    return found


@BOTH
def test_smoothing_is_that_of_the_textbook(error):
    """Error-state RTS (Sola 2017; Saerkkae & Svensson 2023) on a body that tumbles: the gain in the errors of the
    filter's own points, covariances moved by the Jacobians of the rotations between them."""
    rows = 60
    found = smooth(inertial.spec(error, star=error), columns(rows))
    kf = inertial.textbook(error)
    space, steps = kf.space, []
    for u, z, _ in inertial.readings(rows):
        x, P = kf.x, kf.P
        kf.predict(u, inertial.DT)
        F = derivative(lambda d, x=x, u=u, to=kf.x: space.minus(
            inertial.step(space.plus(x, d), np.zeros(6), u, inertial.DT), to), space.k)  # fmt: skip
        steps.append((x, P, F, kf.x, kf.P))
        for name, (h, R) in inertial.SENSORS.items():
            if name in z:
                kf.update(z[name], h, R, measured=Space(4, (0,), error) if name == "star" else None)
    x, P = kf.x, kf.P
    for k in reversed(range(rows)):
        sigma = np.sqrt(np.diag(P))
        assert np.abs(space.minus(found.x[k], x) / sigma).max() < 1e-6
        assert np.abs((found.P[k] - P) / np.outer(sigma, sigma)).max() < 1e-6
        before, spread, F, after, predicted = steps[k]
        G = np.linalg.solve(predicted, F @ spread).T
        ahead = space.minus(x, after)
        d = G @ ahead
        J, T = np.linalg.inv(space.reset(ahead)), space.reset(d)
        P = T @ (spread + G @ (J @ P @ J.T - predicted) @ G.T) @ T.T
        x = space.unit(space.plus(before, d))


SMALL = """
kfgen: 1
name: small
scalar: double
dt: 0.1
states: {STATE, b: {vector: 3, init: 0, std: 1e-4}}
inputs: {gyro: {vector: 3, range: [-0.001, 0.001]}}
noise: {w: {vector: 3, std: 2e-4}}
dynamics: {form: continuous, integrator: euler, f: {a: gyro - b + w}, Q: {b: 1e-12}}
measurements:
  star: {z: {a: {h: a, std: [1e-4, 2e-4, 3e-4]}}}
filter: {FILTER}
"""
TURNS = "a: {kind: quaternion, init: [1, 0, 0, 0], std: 1e-3, error: SIDE}"
ADDS = "a: {vector: 3, init: 0, std: 1e-3}"


@pytest.mark.parametrize("kind", ["type: ekf", "type: iekf", "type: ukf, sigma_points: {kind: cubature}"])
@BOTH
def test_small_rotations_are_smoothed_as_vectors_are(kind, error):
    turns = loads(SMALL.replace("STATE", TURNS.replace("SIDE", error)).replace("FILTER", kind))
    adds = loads(SMALL.replace("STATE", ADDS).replace("FILTER", "type: kf"))
    data = dict(simulate(turns, 50, 4, {"star": 3}).columns)
    q = np.column_stack([data[f"star.a_{part}"] for part in "wxyz"])
    vectors = dict(data) | dict(zip((f"star.a_{part}" for part in "xyz"), 2 * q[:, 1:].T * np.sign(q[:, 0]),
                                    strict=True))  # fmt: skip
    found, right = smoothed(turns, data)[1], smoothed(adds, vectors)[1]
    sigma = np.sqrt(right.var)
    assert np.abs(2 * found.x[:, 1:4] * np.sign(found.x[:, :1]) - right.x[:, :3]).max() < 5e-3 * sigma[:, :3].min()
    assert np.abs(found.var / right.var - 1).max() < 2e-3
    assert (found.var <= found.run.var * (1 + 1e-9)).all()


def test_smoothing_is_the_most_likely_track():
    """Gauss-Newton over all attitudes at once; the iterated filter and the smoother are near it."""
    spec = loads(SMALL.replace("STATE", TURNS.replace("SIDE", "body")).replace("FILTER", "type: iekf, iterations: 5")
                 .replace("1e-3", "0.2").replace("2e-4", "0.02").replace("1e-4", "0.01")
                 .replace("3e-4", "0.03").replace("0.001", "2"))  # fmt: skip
    data = dict(simulate(spec, 14, 4).columns)
    gyro = np.column_stack([data[f"gyro_{part}"] for part in "xyz"])
    z = np.column_stack([data[f"star.a_{part}"] for part in "wxyz"])
    R = np.array([0.01, 0.02, 0.03])

    def residuals(y):
        turn, bias = [exp(y[6 * k : 6 * k + 3]) for k in range(15)], y.reshape(15, 6)[:, 3:]
        q = [turn[0]]
        for k in range(14):  # each as it is off from the one that the gyro leads to
            q.append(compose(compose(q[-1], exp(0.1 * (gyro[k] - bias[k]))), turn[k + 1]))
        terms = [y[:3] / 0.2, bias[0] / 0.01, *(y[6 * k : 6 * k + 3] / (0.1 * 0.02) for k in range(1, 15))]
        terms += [(bias[k + 1] - bias[k]) / 1e-6 for k in range(14)]
        terms += [log(compose(q[k + 1] * [1, -1, -1, -1], z[k])) / R for k in range(14)]
        residuals.q = q
        return np.concatenate(terms)

    best = least_squares(residuals, np.zeros(90), x_scale="jac", xtol=1e-12, ftol=1e-12)
    residuals(best.x)
    found = smoothed(spec, data)[1]
    apart = differences(spec, found.x, np.column_stack([residuals.q[1:], best.x.reshape(15, 6)[1:, 3:]]))
    assert np.abs(apart / np.sqrt(found.var)).max() < 0.05


LATE = """
kfgen: 1
name: lateatt
scalar: double
dt: {nominal: 0.1}
parameters: {field: {vector: 3, value: [0.9, 0.1, -0.5]}, level: {vector: 2, value: 0.1}}
states:
  q: {kind: quaternion, init: [1, 0, 0, 0], std: 1, error: reference}
  p: {vector: 2, init: 0, std: 9}
inputs: {gyro: {vector: 3, range: [-2, 2]}}
noise: {w: {vector: 3, root_density: 0.03}}
dynamics: {form: continuous, integrator: euler, f: {q: gyro - w}, Q: {p: 0.01*dt}}
measurements:
  mag: {z: {b: {h: "unrotate(q, field)", std: [0.03, 0.02, 0.04]}}}
  star: {z: {q: {h: q, std: [0.02, 0.02, 0.05]}}}
  fix: {partial: true, inputs: {sigma: {range: [0.3, 2]}}, z: {p: {h: p + level, std: sigma}}}
initialize:
  - {from: star, states: {q: q}, var: {q: [4e-4, 4e-4, 25e-4]}}
  - {from: fix, states: {p: p}, var: {p: sigma**2}}
outputs: {tilt: {value: "acos(rotation(q)[2][2])"}}
filter: {type: ekf, covariance: full, update: joseph}
history: {steps: 8}
"""


@pytest.fixture(scope="module")
def late():
    spec = loads(LATE)
    log = simulate(spec, 120, 2, {"star": 4, "fix": 2})
    return spec, log, delayed(spec, log, {"star": 0.45, "fix": 0.2}), kfgen.compile(spec, history=True)


def test_the_budget_is_all_of_the_covariance(late):
    """Causes through first measurements, turns, inputs of sensors and readings put back to where they were made."""
    spec, _, log, kf = late
    kf.init()
    came = trace(kf, log)
    kf.init()
    in_time = trace(kf, settled(came.work, 8).work)
    walk = Walker(spec, in_time).walk(len(in_time.work.t))
    P = in_time.P[-1]
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert np.abs((walk.parts.sum(axis=0) - P) / scale).max() < 1e-9
    assert np.abs((came.P[-1] - P) / scale).max() < 1e-9
    assert not walk.parts[0].any()  # nothing of the start is left
    assert in_time.setting.sum() == 2
    for name in ("star", "fix"):
        mine = in_time.nis[(in_time.sensor == list(kf.sensors).index(name)) & np.isfinite(in_time.nis)]
        np.testing.assert_allclose(np.nansum(walk.innovations[name].e ** 2, axis=1), mine, rtol=1e-6)
    last = [runs.nis[runs.sensor == list(kf.sensors).index("star")] for runs in (came, in_time)]
    np.testing.assert_allclose(*last, rtol=1e-9)  # all that is known of its time has come before it


def test_late_readings_are_smoothed_where_they_were_made(late):
    spec, log, came, _ = late
    work, arrived = plan(spec, came), dict(log.columns)
    for name, parts in (("star", ("q_w", "q_x", "q_y", "q_z")), ("fix", ("p_x", "p_y", "sigma"))):
        i = [sensor.name for sensor in spec.measurements].index(name)
        came_in = np.flatnonzero(work.mask[:, i])
        made = came_in - work.age[came_in, i]
        for part in parts:  # those that would come after the end are lost
            kept = np.full(120, np.nan)
            kept[made] = log.columns[f"{name}.{part}"][made]
            arrived[f"{name}.{part}"] = kept
    found, right = smoothed(spec, came)[1], smoothed(spec, arrived)[1]
    np.testing.assert_allclose(found.x, right.x, atol=1e-12)
    np.testing.assert_allclose(found.P, right.P, atol=1e-12)
    np.testing.assert_allclose(found.output_std["tilt"], right.output_std["tilt"], atol=1e-12)
    truth = np.column_stack([log.columns[f"true.{state.name}"] for state in spec.states])
    after, before = (np.square(differences(spec, x, truth)[20:]).mean() for x in (found.x, found.run.x))
    assert after < before


def test_numbers_of_vectors_are_tuned_through_the_past(late):
    spec, _, log, _ = late
    found = tune(spec, log, ["parameters.field.y", "parameters.level", "star.z.q.std[2]"], holdout=0)
    assert [each["old"] for each in found["parameters"]] == [0.1, 0.1, 0.05]
    assert abs(found["parameters"][0]["new"] - 0.1) < 4 * found["parameters"][0]["std_error"]
    likely = kfgen.compile(replace(spec, code=replace(spec.code, log_likelihood=True)), history=True)
    run = likely.run(log)
    total = sum(float(np.nansum(each)) for each in run.log_likelihood.values())
    assert found["log_likelihood"]["before"] == pytest.approx(total, rel=1e-9)
    with pytest.raises(KfgenError, match="name a number of it as a parameter"):
        tune(spec, log, ["mag.z.b.h"])
    found = tune(spec, log, ["noise.w.root_density"], objective="rmse", holdout=0)
    assert 0.003 < found["parameters"][0]["new"] < 0.3


def test_the_report_counts_errors(late):
    spec, _, came, _ = late
    found = kfgen.report(spec, [came], target="host")
    assert found["nees"]["verdict"] in ("consistent", "cautious")
    assert set(found["rmse"]) == set(found["budget"]) == set(spec.errors)
    assert found["nis"]["star"]["number"] == 28  # of 30 one sets, one is lost
    assert found["observability"]["rank"] == 5
    assert set(found["outputs"]) == {"tilt"}
