"""Monte Carlo runs of matched models: the squared errors are as large as the covariance says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import one_state
from scipy.stats import chi2

from kfgen.reference import reference
from kfgen.spec import loads

RUNS, STEPS = 200, 6

# position and velocity; the position is measured with a constant bias of its own
MOVING = """
kfgen: 1
name: moving
scalar: double
dt: 0.5
states:
  p: {init: 1, var: 0.5}
  v: {init: -0.5, var: 0.4}
  b: {init: 0, var: 0.3}
dynamics:
  form: discrete
  f: {p: p + dt*v}
  Q: {p: 0.01, v: 0.05}
measurements:
  s:
    z:
      z: {h: H, var: 0.2}
      w: {h: 0.5*v, var: 0.1}
filter: {type: OPTIONS}
"""
F = np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
SLIGHTLY_BENT = "4*sinh(p/8 + 0.5) + b", lambda p: 4 * np.sinh(p / 8 + 0.5)
LINEAR = "p + b", lambda p: p


def band(n: int) -> tuple[float, float]:
    """Where the mean of RUNS squared normalised errors of n states lies in 99 % of all cases."""
    low, high = chi2.ppf([0.005, 0.995], RUNS * n)
    return float(low) / RUNS, float(high) / RUNS


def nees(kf, x: np.ndarray) -> float:
    d = kf.x - x
    return float(d @ np.linalg.solve(kf.P, d))


@pytest.mark.parametrize(
    ("options", "sensor"),
    [
        ("kf", LINEAR),
        ("kf, covariance: sqrt", LINEAR),
        ("kf, update: joseph, consider: [b]", LINEAR),
        ("ekf", SLIGHTLY_BENT),
        ("ekf, covariance: sqrt", SLIGHTLY_BENT),
        ("iekf", SLIGHTLY_BENT),
        ("ekf2", SLIGHTLY_BENT),
    ],
)
def test_matched(options, sensor):
    h, truth = sensor
    kf = reference(loads(MOVING.replace("H,", f'"{h}",').replace("OPTIONS", options)))
    rng = np.random.default_rng(17)
    total = 0.0
    for _ in range(RUNS):
        kf.init()
        x = np.array([1.0, -0.5, 0.0]) + rng.normal(size=3) * np.sqrt([0.5, 0.4, 0.3])
        for _ in range(STEPS):
            x = F @ x + rng.normal(size=3) * np.sqrt([0.01, 0.05, 0.0])
            z = np.array([truth(x[0]) + x[2], 0.5 * x[1]]) + rng.normal(size=2) * np.sqrt([0.2, 0.1])
            kf.predict()
            kf.update("s", z)
        total += nees(kf, x)
    low, high = band(3)
    assert low < total / RUNS < high


@pytest.mark.parametrize(("kind", "consistent"), [("ekf", False), ("ekf2", True)])
def test_strong_curvature_needs_the_second_order(kind, consistent):
    """z = x^2/2 + v about x = 2: the ekf takes the mean of x^2 for the square of the mean."""
    text = one_state("  form: discrete\n  f: {x: x}", z="{h: x**2/2, var: 0.3}").replace("init: 1", "init: 2")
    kf = reference(loads(text.replace("{type: ekf}", f"{{type: {kind}}}")))
    rng = np.random.default_rng(23)
    total = 0.0
    for _ in range(RUNS):
        kf.init()
        x = 2.0 + math.sqrt(0.5) * rng.normal()
        kf.update("s", [x**2 / 2 + math.sqrt(0.3) * rng.normal()])
        total += nees(kf, np.array([x]))
    low, high = band(1)
    assert (low < total / RUNS < high) == consistent
