"""The steady-state gain against scipy, against filters that have settled, and where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import BALL, CV4, SIX_SENSORS, one_state
from scipy.linalg import block_diag, solve_discrete_are

from kfgen.errors import SpecError
from kfgen.reference import Status, reference
from kfgen.spec import loads

# two sensors, one with noise inputs and a full R, inputs, an angle, process noise through an input
TRACK = """
kfgen: 1
name: track
scalar: double
dt: 0.1
parameters: {offset: 0.2}
states:
  p: {init: 1, var: 2}
  v: {init: 0, var: 1}
  th: {init: 0.3, var: 0.2, kind: angle}
  b: {init: 0, var: 1}
inputs: {a: {}}
noise: {jerk: {var: 0.5}}
dynamics:
  form: discrete
  f: {p: p + dt*v, v: 0.98*v + dt*(a + jerk), th: th + dt*v, b: 0.9*b + offset}
  Q: {p: 0.001, th: 0.002, b: 0.01}
measurements:
  first:
    z:
      x: {h: p + b + 0.5*common}
      y: {h: 2*p - b + a + 0.5*common}
    R: [[0.3, 0.1], [0.1, 0.4]]
    noise: {common: {var: 0.2}}
  second:
    z:
      heading: {h: th, var: 0.1, kind: angle}
    gate: {probability: 0.99}
filter: {type: kf, gain: steady}
"""
F = np.array([[1, 0.1, 0, 0], [0, 0.98, 0, 0], [0, 0.1, 1, 0], [0, 0, 0, 0.9]])
Q = np.diag([0.001, 0.1**2 * 0.5, 0.002, 0.01])
H1 = np.array([[1.0, 0, 0, 1], [2, 0, 0, -1]])
R1 = np.array([[0.3, 0.1], [0.1, 0.4]]) + 0.05
H2 = np.array([[0.0, 0, 1, 0]])


def build(text: str):
    return reference(loads(text))


def moving(text: str) -> str:
    return text.replace(", gain: steady", "")


def stages() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P before the first sensor, before the second, and after it."""
    before = solve_discrete_are(F.T, np.vstack([H1, H2]).T, Q, block_diag(R1, 0.1))
    between = before - before @ H1.T @ np.linalg.solve(H1 @ before @ H1.T + R1, H1 @ before)
    S = H2 @ between @ H2.T + 0.1
    return before, between, between - between @ H2.T @ np.linalg.solve(S, H2 @ between)


@pytest.mark.parametrize("form", ["ud", "ud, update: joseph", "full", "full, update: standard", "sqrt"])
def test_scipy(form):
    kf = build(TRACK.replace("gain: steady", f"gain: steady, covariance: {form}"))
    before, between, after = stages()
    np.testing.assert_allclose(kf.P, after, rtol=1e-11, atol=1e-14)
    x = np.array([1.0, 0.0, 0.3, 0.0])
    assert kf.predict([2.0]) == 0
    x = np.array([x[0], 0.2, 0.3, 0.2])
    np.testing.assert_allclose(kf.x, x, rtol=1e-15)
    S = H1 @ before @ H1.T + R1
    y = np.array([1.5, 4.5]) - np.array([1.2, 1.8 + 2.0])
    assert kf.update("first", [1.5, 4.5], [2.0]) == 0
    x = x + before @ H1.T @ np.linalg.solve(S, y)
    np.testing.assert_allclose(kf.x, x, rtol=1e-11)
    nis = y @ np.linalg.solve(S, y)
    assert kf.nis == pytest.approx(nis, rel=1e-11)
    assert kf.log_likelihood == pytest.approx(-math.log(2 * math.pi) - nis / 2 - np.linalg.slogdet(S)[1] / 2)
    s = between[2, 2] + 0.1
    assert kf.update("second", [x[2] + 0.5 + 4 * math.pi]) == 0
    np.testing.assert_allclose(kf.x, x + between[:, 2] / s * 0.5, rtol=1e-10)
    assert kf.nis == pytest.approx(0.25 / s, rel=1e-11)
    np.testing.assert_allclose(kf.P, after, rtol=1e-11, atol=1e-14)


def test_a_filter_that_has_settled():
    kf, settled = build(TRACK), build(moving(TRACK))
    rng = np.random.default_rng(3)
    for k in range(450):
        a, z, th = rng.normal(size=1), rng.normal(size=2), rng.normal(size=1) * 0.1
        if k == 400:
            assert kf.set_state(settled.x) == 0
        for each in (kf, settled):
            each.predict(a)
            each.update("first", z, a)
            each.update("second", th)
        if k >= 400:
            np.testing.assert_allclose(kf.x, settled.x, rtol=1e-12, atol=1e-13)
            assert kf.nis == pytest.approx(settled.nis, rel=1e-11)
            assert kf.log_likelihood == pytest.approx(settled.log_likelihood, rel=1e-11)
    scale = np.sqrt(np.outer(kf.P.diagonal(), kf.P.diagonal()))
    assert np.max(np.abs(kf.P - settled.P) / scale) < 1e-12


@pytest.mark.parametrize("text", [BALL, CV4.replace("1e-6", "1e-1").replace("400", "4")])
def test_problems_settle_there(text):
    kf, settled = (build(text.replace("ekf", kind)) for kind in ("kf, gain: steady", "kf"))
    for _ in range(900):
        settled.predict()
        for name, sensor in settled.sensors.items():
            settled.update(name, np.zeros(sensor.m))
    scale = np.sqrt(np.outer(kf.P.diagonal(), kf.P.diagonal()))
    assert np.max(np.abs(kf.P - settled.P) / scale) < 1e-12


def test_gate_and_errors():
    kf = build(TRACK)
    kf.predict([0.0])
    x, P = kf.x, kf.P
    assert kf.update("second", [kf.x[2] + 2.0]) == Status.GATED
    assert kf.nis == pytest.approx(4.0 / (stages()[1][2, 2] + 0.1), rel=1e-10)
    assert kf.update("second", [math.nan]) == Status.NOT_FINITE
    assert kf.predict([math.inf]) == Status.NOT_FINITE
    np.testing.assert_array_equal(kf.x, x)
    np.testing.assert_array_equal(kf.P, P)
    with pytest.raises(AttributeError):
        kf.set_covariance(np.eye(4))
    with pytest.raises(AttributeError):
        build(TRACK.replace("gain: steady", "gain: steady, covariance: sqrt")).set_sqrt_covariance(np.eye(4))
    kf.parameters["offset"] = math.inf
    assert kf.predict([0.0]) == Status.NOT_FINITE
    assert kf.init() == 0
    np.testing.assert_array_equal(kf.P, P)


def one(f: str, Q: str, z: str = "{h: x, var: 1}", states: str = "", options: str = "") -> str:
    text = one_state(f"  form: discrete\n  f: {f}\n  Q: {Q}", z=z, states=states)
    return text.replace("{type: ekf}", f"{{type: kf, gain: steady{options}}}")


SECOND = "  y: {init: 0, var: 1}"


@pytest.mark.parametrize(
    ("f", "Q", "z", "states"),
    [
        ("{x: x}", "{}", "{h: x, var: 1}", ""),  # a constant: its variance falls for ever
        ("{x: x}", "{x: 1, y: 1}", "{h: y, var: 1}", SECOND),  # a random walk that nobody sees
        ("{x: 1.1*x}", "{x: 1, y: 1}", "{h: y, var: 1}", SECOND),
        ("{x: x + y}", "{x: 0.1}", "{h: x, var: 1}", SECOND),
    ],
)
def test_no_steady_state(f, Q, z, states):
    with pytest.raises(SpecError, match=r"filter\.gain: no steady state: "):
        build(one(f, Q, z, states))


@pytest.mark.parametrize(
    ("f", "Q", "z", "states", "variances"),
    [
        ("{x: 1.25*x}", "{}", "{h: x, var: 1}", "", [1 - 1 / 1.25**2]),  # unstable, and known well enough
        ("{x: 0.999*x}", "{}", "{h: x, var: 1}", "", [0.0]),  # it dies out
        ("{x: x + y, y: 0.99*y}", "{x: 2}", "{h: x, var: 1}", SECOND, [2 / 3, 0.0]),
        ("{x: x}", "{x: 1}", "{h: x, var: 0}", "", [0.0]),  # an exact sensor
        ("{x: x}", "{x: 1}", "{h: x, var: 0}\n      z2: {h: 2*x, var: 0}", "", [0.0]),  # twice
        ("{x: x}", "{x: 1e-8}", "{h: x, var: 1}", "", [(math.sqrt(1e-16 + 4e-8) - 1e-8) / 2]),  # slow
        ("{x: y, y: 0.5*y}", "{y: 3}", "{h: 0*x, var: 1}", SECOND, [4.0, 4.0]),  # not seen, but stable
    ],
)
def test_semidefinite(f, Q, z, states, variances):
    kf = build(one(f, Q, z, states))
    if variances == [2 / 3, 0.0]:
        variances[0] = (math.sqrt(4 + 8) - 2) / 2
    np.testing.assert_allclose(kf.P.diagonal(), variances, rtol=1e-11)
    kf.predict()
    assert kf.update("s", [1.0] * kf.sensors["s"].m) == 0
    assert np.all(np.isfinite(kf.x))


def test_six_sensors_are_one():
    seen = SIX_SENSORS.replace("type: kf", "type: kf, gain: steady").replace("f: {x: x}", "f: {x: x}\n  Q: {x: 6}")
    # six sensors are one with a sixth of the variance: P^2 + 6 P = 1 after the update
    assert build(seen).P[0, 0] == pytest.approx(math.sqrt(10) - 3, rel=1e-13)


LIMITED = ["consider: [y]", "gain_limit: 0.3", "innovation_floor: 2.5"]


@pytest.mark.parametrize("options", LIMITED)
def test_options_that_change_the_update_have_their_own_limit(options):
    """It is where the moving filter with the same options ends, with its gain."""
    text = one("{x: x, y: 0.9*y}", "{x: 0.2, y: 0.1}", "{h: x + y, var: 1}", SECOND, f", update: joseph, {options}")
    kf, settled = build(text), build(moving(text))
    for k in range(400):
        settled.predict()
        settled.update("s", [math.sin(k)])
    np.testing.assert_allclose(kf.P, settled.P, rtol=1e-11)
    kf.set_state(settled.x)
    for each in (kf, settled):
        each.predict()
        each.update("s", [0.7])
    np.testing.assert_allclose(kf.x, settled.x, rtol=1e-11)
    assert kf.nis == pytest.approx(settled.nis, rel=1e-10)


def test_formulas_without_a_value_at_0():
    text = one("{x: x + 1/u}", "{x: 1}").replace("dynamics:", "inputs: {u: {}}\ndynamics:")
    kf = build(text)
    assert kf.P[0, 0] == pytest.approx((math.sqrt(5) - 1) / 2, rel=1e-13)
    assert kf.predict([0.0]) == Status.NOT_FINITE
    assert kf.predict([2.0]) == 0
    assert kf.x[0] == 1.5
