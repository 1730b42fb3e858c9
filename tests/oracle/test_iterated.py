"""The iterated filter: the minimum of its posterior, its steps, and what it shares with the ekf."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import ATT, NOISE_INPUTS, RADAR, one_state
from scipy.optimize import least_squares

from kfgen.reference import Status, reference
from kfgen.reference.model import wrap
from kfgen.spec import loads

BEACONS = np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 5.0]])

RANGES = """
kfgen: 1
name: ranges
scalar: double
states:
  x: {init: 1.5, std: 2}
  y: {init: 3.5, std: 2}
covariances: [[x, y, 1]]
dynamics:
  form: discrete
  f: {}
measurements:
  s:
    z:
      a: {h: "hypot(x, y)"}
      b: {h: "hypot(x - 4, y)"}
      c: {h: "hypot(x - 1, y - 5)"}
    R: [[0.04, 0.01, 0], [0.01, 0.04, 0], [0, 0, 0.09]]
filter: {type: iekf, iterations: 20}
"""
PRIOR = np.array([1.5, 3.5])
P0 = np.array([[4.0, 1.0], [1.0, 4.0]])
R = np.array([[0.04, 0.01, 0], [0.01, 0.04, 0], [0, 0, 0.09]])


def build(text: str):
    return reference(loads(text))


def ranges(x):
    d = x - BEACONS
    return np.hypot(d[:, 0], d[:, 1]), d / np.hypot(d[:, 0], d[:, 1])[:, None]


def whitened(z, x):
    """Whose sum of squares is twice the negative logarithm of the posterior density."""
    prior = np.linalg.solve(np.linalg.cholesky(P0), x - PRIOR)
    return np.concatenate([prior, np.linalg.solve(np.linalg.cholesky(R), z - ranges(x)[0])])


def slopes(x):
    return np.vstack([np.linalg.inv(np.linalg.cholesky(P0)), -np.linalg.solve(np.linalg.cholesky(R), ranges(x)[1])])


@pytest.mark.parametrize("form", ["ud", "ud, update: joseph", "full", "full, update: standard", "sqrt"])
@pytest.mark.parametrize("truth", [(2.5, 1.5), (3.0, 4.0), (0.5, 2.5)])
def test_converges_to_the_posterior_mode(form, truth):
    z = ranges(np.array(truth))[0] + [0.05, -0.05, 0.1]
    kf = build(RANGES.replace("type: iekf", f"type: iekf, covariance: {form}"))
    assert kf.update("s", z) == 0
    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    best = least_squares(lambda x: whitened(z, x), PRIOR, jac=slopes, **exact).x
    np.testing.assert_allclose(kf.x, best, rtol=1e-9)
    np.testing.assert_allclose(slopes(kf.x).T @ whitened(z, kf.x), 0.0, atol=1e-12)
    H = ranges(best)[1]
    np.testing.assert_allclose(kf.P, np.linalg.inv(np.linalg.inv(P0) + H.T @ np.linalg.solve(R, H)), rtol=1e-8)
    y, H0 = z - ranges(PRIOR)[0], ranges(PRIOR)[1]
    assert kf.nis == pytest.approx(y @ np.linalg.solve(H0 @ P0 @ H0.T + R, y), rel=1e-10)
    y, S = z - ranges(best)[0] - H @ (PRIOR - best), H @ P0 @ H.T + R
    likelihood = -0.5 * (3 * math.log(2 * math.pi) + y @ np.linalg.solve(S, y) + np.linalg.slogdet(S)[1])
    assert kf.log_likelihood == pytest.approx(likelihood, rel=1e-8)


@pytest.mark.parametrize("iterations", [1, 2, 3, 5])
def test_gauss_newton_steps(iterations):
    z = np.array([2.8, 2.2, 3.6])
    kf = build(RANGES.replace("iterations: 20", f"iterations: {iterations}"))
    assert kf.update("s", z) == 0
    x = PRIOR
    for _ in range(iterations):
        h, H = ranges(x)
        K = P0 @ H.T @ np.linalg.inv(H @ P0 @ H.T + R)
        x = PRIOR + K @ (z - h - H @ (PRIOR - x))
    np.testing.assert_allclose(kf.x, x, rtol=1e-12)
    np.testing.assert_allclose(kf.P, P0 - K @ H @ P0, rtol=1e-11)


@pytest.mark.parametrize("text", [RADAR, NOISE_INPUTS, ATT])
def test_one_iteration_is_the_ekf(text):
    one = build(text.replace("type: ekf", "type: iekf, iterations: 1"))
    ekf = build(text)
    rng = np.random.default_rng(4)
    u = np.full(len(ekf.model.inputs), 0.3)
    for _ in range(10):
        for kf in (one, ekf):
            kf.predict(u, 0.1 if kf.spec.dt.run_time else None)
        for sensor in ekf.sensors.values():
            z = rng.normal(size=sensor.m)
            assert one.update(sensor.name, z, u) == ekf.update(sensor.name, z, u)
            assert (one.nis, one.log_likelihood) == (ekf.nis, ekf.log_likelihood)
    np.testing.assert_array_equal(one.x, ekf.x)
    np.testing.assert_array_equal(one.P, ekf.P)


# a robot that sees the bearing of a landmark behind it, where its own heading and the bearing wrap
BEARINGS = """
kfgen: 1
name: bearings
scalar: double
states:
  x: {init: 0, std: 0.5}
  th: {init: 3.1, std: 0.6, kind: angle}
dynamics:
  form: discrete
  f: {}
measurements:
  s:
    z:
      left: {h: "atan2(2, -x) - th", std: 0.02, kind: angle}
      right: {h: "atan2(-3, 1 - x) - th + 0.2*slope*th", std: 0.02, kind: angle}
    noise: {slope: {std: 0.1}}
filter: {type: iekf, iterations: 3}
"""


def bearings(x, th):
    h = np.array([math.atan2(2, -x) - th, math.atan2(-3, 1 - x) - th])
    H = np.array([[2 / (4 + x * x), -1], [-3 / (9 + (1 - x) ** 2), -1]])
    return h, H, np.array([0.0, 0.2 * th])


def turned(v):
    return wrap(float(v), 2 * math.pi)


def test_differences_of_angles_are_wrapped():
    """Every step of the iteration by hand: the heading crosses pi, R depends on the iterate."""
    kf = build(BEARINGS)
    z = [turned(v) for v in bearings(0.4, 3.1 + 0.7)[0]]
    assert kf.update("s", z) == 0
    prior, P = np.array([0.0, 3.1]), np.diag([0.25, 0.36])
    x, crossed = prior, False
    for _ in range(3):
        h, H, M = bearings(*x)
        y = np.array([turned(v) for v in z - h]) - H @ [prior[0] - x[0], turned(prior[1] - x[1])]
        S = H @ P @ H.T + 4e-4 * np.eye(2) + 0.01 * np.outer(M, M)
        x = prior + P @ H.T @ np.linalg.solve(S, y)
        crossed |= x[1] > math.pi
        x[1] = turned(x[1])
    assert crossed
    np.testing.assert_allclose(kf.x, x, rtol=1e-12)
    np.testing.assert_allclose(kf.P, P - P @ H.T @ np.linalg.solve(S, H @ P), rtol=1e-10)
    assert kf.x[1] < 0


def test_bounds_hold_at_the_end_only():
    """The first iterate lies beyond the bound, where the iteration goes on from it."""
    text = one_state("  form: discrete\n  f: {x: x}", z="{h: x**2, var: 0.01}")
    text = text.replace("{init: 1, var: 0.5}", "{init: 1, var: 0.5, bounds: [0, 1.9]}")
    kf = build(text.replace("{type: ekf}", "{type: iekf, iterations: 3}"))
    assert kf.update("s", [3.0]) == 0
    x, iterates = 1.0, []
    for _ in range(3):
        s = 4 * x * x * 0.5 + 0.01
        x = 1.0 + 2 * x * 0.5 / s * (3.0 - x * x - 2 * x * (1.0 - x))
        iterates.append(x)
    assert iterates[0] > 1.9 > iterates[2]
    assert kf.x[0] == pytest.approx(iterates[2], rel=1e-13)
    assert kf.update("s", [9.0]) == 0
    assert kf.x[0] == 1.9


def test_the_gate_judges_the_first_linearisation():
    text = RANGES.replace("filter:", "    gate: {probability: 0.999}\nfilter:")
    kf = build(text)
    assert kf.update("s", [30.0, 1.0, 1.0]) == Status.GATED
    np.testing.assert_array_equal(kf.x, PRIOR)
    np.testing.assert_array_equal(kf.P, P0)


def test_an_iterate_without_a_value_leaves_all_as_it_was():
    text = one_state("  form: discrete\n  f: {x: x}", z="{h: log(x), var: 0.01}")
    kf = build(text.replace("{type: ekf}", "{type: iekf, iterations: 2}"))
    before = kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood
    assert kf.update("s", [-2.0]) == Status.NOT_FINITE  # the first step leads to x < 0
    assert (kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood) == before
    assert kf.update("s", [0.2]) == 0


def test_options_act_in_every_linear_update():
    """gain_limit, consider and the floor, step by step."""
    z = "{h: x**2/4 + y, var: 0.01}"
    text = one_state("  form: discrete\n  f: {}", z=z, states="  y: {init: 0.1, var: 0.3}")
    options = "iterations: 3, update: joseph, consider: [y], gain_limit: 0.75, innovation_floor: 0.5"
    kf = build(text.replace("{type: ekf}", f"{{type: iekf, {options}}}"))
    prior, P = np.array([1.0, 0.1]), np.diag([0.5, 0.3])
    assert kf.update("s", [2.0]) == Status.REGULARIZED  # in the first of them
    x, limited, floored = prior, [], []
    for _ in range(3):
        h = np.array([x[0] / 2, 1.0])
        s, r = h @ P @ h + 0.01, 0.01
        floored.append(s < 0.5)
        if s < 0.5:
            s, r = 0.5, 0.5 - h @ P @ h
        K = P @ h / s * [1, 0]
        limited.append(K[0] > 0.75)
        K = np.minimum(K, 0.75)
        nu = 2.0 - x[0] ** 2 / 4 - x[1] - h @ (prior - x)
        x = prior + K * nu
    A = np.eye(2) - np.outer(K, h)
    np.testing.assert_allclose(kf.x, x, rtol=1e-13)
    np.testing.assert_allclose(kf.P, A @ P @ A.T + r * np.outer(K, K), rtol=1e-12)
    assert floored == [True, False, False]
    assert kf.nis == pytest.approx((2.0 - 0.35) ** 2 / 0.5)
    assert kf.log_likelihood == pytest.approx(-0.5 * (math.log(2 * math.pi) + nu**2 / s + math.log(s)))


def test_semidefinite():
    """An exact range, a prior that knows one direction, and the same sensor twice."""
    text = RANGES.replace("[[0.04, 0.01, 0], [0.01, 0.04, 0], [0, 0, 0.09]]", "[[0, 0, 0], [0, 0.04, 0], [0, 0, 0]]")
    text = text.replace('c: {h: "hypot(x - 1, y - 5)"}', 'c: {h: "hypot(x, y)"}')
    kf = build(text)
    assert kf.set_covariance([[1.0, 0.0], [0.0, 0.0]]) == 0
    assert kf.update("s", [4.0, 3.9, 4.0]) == 0
    assert np.hypot(*kf.x) == pytest.approx(4.0, rel=1e-14)
    assert kf.x[1] == 3.5
    np.testing.assert_allclose(kf.P, np.zeros((2, 2)), atol=1e-15)
