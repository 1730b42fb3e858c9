"""The smoother: against dense least squares over a whole track, against the truth, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kfgen.errors import KfgenError
from kfgen.reference import smooth
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.simulate import simulate
from kfgen.smoothing import smoothed
from kfgen.spec import loads

LINEAR = """
kfgen: 1
name: linear
scalar: double
dt: {nominal: 0.1}
states:
  p: {init: 1, std: 2}
  v: {init: -1, std: 1}
  b: {init: 0, std: 0.5}
covariances: [[p, v, 0.6]]
inputs: {a: {range: [-3, 3]}}
noise: {w: {std: 0.4}}
dynamics:
  form: discrete
  f: {p: p + dt*v, v: v + dt*(a + w), b: 0.9*b}
  Q: [[0.002, 0.001, 0], [0.001, 0.003, 0], [0, 0, 0.01]]
measurements:
  fix: {partial: true, z: {p: {h: p + b}, s: {h: v}}, R: [[0.3, 0.1], [0.1, 0.2]]}
  other: {z: {p: {h: p - 0.5*v, std: 0.7}}}
filter: {type: kf, FORM}
"""


def gappy(spec, rows=40, seed=3):
    """A log with rows of equal t, missing sensors and missing components."""
    log = dict(simulate(spec, rows, seed, {"other": 3}).columns)
    log["t"] = log["t"].copy()
    log["t"][[5, 6, 21]] = log["t"][[4, 4, 20]]
    log["fix.p"] = np.where(np.arange(rows) % 4 == 1, np.nan, log["fix.p"])
    log["fix.s"] = np.where(np.arange(rows) % 5 == 2, np.nan, log["fix.s"])
    return log


def batch(spec, log):
    """Means and covariances of all states of a linear track by weighted least squares, all steps at once."""
    model = Model(spec)
    process, sensors = Process(model), [SensorModel(model, each) for each in spec.measurements]
    n, t, zero = model.n, log["t"], np.zeros(model.n)
    at, k = [], 0
    blocks = [(np.eye(n), 0, None, model.x0, model.P0)]  # A x_j - B x_i = c, covariance
    for row in range(len(t)):
        u = np.array([log[name][row] for name in model.inputs])
        if row and t[row] != t[row - 1]:
            step = process.linearise(zero, Context(model.values, u, 0.0, float(t[row] - t[row - 1])))
            blocks.append((np.eye(n), k + 1, step.F, step.x, step.Q))
            k += 1
        at.append(k)
        for sensor in sensors:
            z = np.array([log[f"{sensor.name}.{c}"][row] for c in sensor.components])
            used = tuple(np.flatnonzero(~np.isnan(z)))
            if used and (sensor.partial or len(used) == sensor.m):
                seen = sensor.linearise(zero, Reading(sensor, z, used, Context(model.values, u, 0.0, 0.0)))
                blocks.append((seen.H, k, None, z[list(used)] - seen.h, seen.R))
    information, right = np.zeros((n * (k + 1), n * (k + 1))), np.zeros(n * (k + 1))
    for A, j, F, c, R in blocks:
        J = np.zeros((len(A), n * (k + 1)))
        J[:, n * j : n * (j + 1)] = A
        if F is not None:
            J[:, n * (j - 1) : n * j] = -F
        W = np.linalg.inv(R)
        information += J.T @ W @ J
        right += J.T @ W @ c
    P = np.linalg.inv(information)
    x = (P @ right).reshape(-1, n)[at]
    return x, np.array([P[n * j : n * (j + 1), n * j : n * (j + 1)] for j in at])


@pytest.mark.parametrize("form", ["covariance: full", "gain: none", "ukf", "iekf", "sqrt"])
def test_equals_least_squares_over_the_whole_track(form):
    chosen = {
        "covariance: full": "type: kf, covariance: full, update: joseph", "gain: none": "type: ekf",
        "ukf": "type: ukf, sigma_points: {kind: merwe, alpha: 0.5}", "iekf": "type: iekf, iterations: 2",
        "sqrt": "type: ukf, covariance: sqrt, sigma_points: {kind: cubature}",
    }[form]  # fmt: skip
    spec = loads(LINEAR.replace("type: kf, FORM", chosen))
    log = gappy(spec)
    x, P = batch(spec, log)
    found = smoothed(spec, log)[1]
    assert np.abs(found.x - x).max() < 1e-9
    assert np.abs(found.P - P).max() < 1e-9


CURVED = """
kfgen: 1
name: curved
dt: 0.1
states:
  x: {init: 0, std: 0.4}
  y: {init: 0, std: 0.4}
  th: {init: 3, std: 0.3, kind: angle}
inputs: {gyro: {range: [-4, 4]}}
noise: {w: {std: 0.2}}
dynamics:
  form: discrete
  f: {x: x + dt*3*cos(th), y: y + dt*3*sin(th), th: th + dt*(gyro + w)}
  Q: {x: 0.001, y: 0.001}
measurements:
  beacon:
    z:
      range: {h: "hypot(x - 9, y - 2)", std: 0.3}
      bearing: {h: "atan2(y - 2, x - 9)", std: 0.05, kind: angle}
    gate: {probability: 0.9999}
filter: {FILTER}
"""


@pytest.mark.parametrize("kind", ["type: ekf", "type: iekf", "type: ukf", "type: ekf, robust: {influence: huber}"])
def test_is_nearer_to_the_truth_than_the_filter(kind):
    spec = loads(CURVED.replace("FILTER", kind))
    squares = np.zeros((2, 3))
    for seed in range(2):
        log = simulate(spec, 90, seed)
        found = smoothed(spec, log)[1]
        truth = np.column_stack([log.columns[f"true.{s.name}"] for s in spec.states])
        for i, x in enumerate((found.run.x, found.x)):
            error = x - truth
            error[:, 2] = np.remainder(error[:, 2] + np.pi, 2 * np.pi) - np.pi
            squares[i] += (error**2).mean(axis=0)
        assert (found.var <= found.run.var * (1 + 1e-9)).all()
        assert np.abs(found.x[:, 2]).max() <= np.pi
    assert (squares[1] < squares[0]).all()


def test_steady_gain_and_singular_predictions():
    spec = loads(LINEAR.replace("{nominal: 0.1}", "0.1").replace("partial: true, ", "").replace("FORM", "gain: steady"))
    log = simulate(spec, 300, 1)
    found = smoothed(spec, log)[1]
    truth = np.column_stack([log.columns[f"true.{s.name}"] for s in spec.states])
    assert (((found.x - truth) ** 2).mean(axis=0) < ((found.run.x - truth) ** 2).mean(axis=0)).all()
    certain = LINEAR.replace("b: {init: 0, std: 0.5}", "b: {init: 0.2, std: 0}").replace("[0, 0, 0.01]", "[0, 0, 0]")
    still = loads(certain.replace("FORM", ""))
    found = smoothed(still, gappy(still))[1]
    assert np.isfinite(found.x).all()
    assert np.abs(found.var[:, 2]).max() < 1e-20


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("type: ekf2", "second derivatives"),
        ("type: ekf, adapt_R: 1e-3", "adapt_R"),
        ("type: ekf, adapt_Q: 1e-3", "adapt_Q"),
    ],
)
def test_refuses_with_the_reason(kind, reason):
    spec = loads(CURVED.replace("FILTER", kind))
    with pytest.raises(KfgenError, match=reason):
        smooth(spec, simulate(spec, 3).columns)


def test_a_bank_is_refused():
    from kfgen.spec import load

    spec = load(Path(__file__).parents[2] / "specs" / "maneuver.yaml")
    with pytest.raises(KfgenError, match="imm"):
        smoothed(spec, simulate(spec, 3))
