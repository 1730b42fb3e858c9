"""Sigma-point filters on simulated tracks: errors are as large as the covariance says."""

from __future__ import annotations

import numpy as np
import pytest
from problems import ALL, ATT, chain
from scipy.stats import chi2

from kfgen.reference import Status, reference
from kfgen.reference.model import Context
from kfgen.spec import loads

OPTIONS = [
    "covariance: full",
    "covariance: ud, sigma_points: {kind: cubature}",
    "covariance: sqrt, sigma_points: {kind: merwe, alpha: 0.3, redraw: false}",
    "sequential: true, sigma_points: {kind: julier, kappa: 0.5}",
]


@pytest.mark.parametrize("options", OPTIONS)
def test_nees(options):
    """The mean normalised squared error over runs and steps lies near the number of states."""
    text = chain(4).replace("type: ekf", f"type: ukf, {options}")
    kf, rng = reference(loads(text)), np.random.default_rng(10)
    errors = []
    for _ in range(25):
        kf.init()
        truth = kf.x + rng.normal(size=4)
        for step in range(30):
            a = -truth[:2] + 0.3 * (truth[1::-1] - 2 * truth[:2]) - 0.05 * truth[2:] - 0.1 * truth[:2] ** 3
            truth = truth + 0.05 * np.concatenate([truth[2:], a]) + rng.normal(size=4) * [1e-3, 1e-3, 1e-2, 1e-2]
            assert kf.predict() == 0
            assert kf.update("position", truth[:1] + 0.1 * rng.normal(size=1)) == 0
            if step % 10 == 9:
                e = kf.x - truth
                errors.append(e @ np.linalg.solve(kf.P, e))
    # the samples of a run are correlated: the bounds are those of one for each
    assert chi2.ppf(1e-4, 100) / 25 < np.mean(errors) < chi2.ppf(1 - 1e-4, 100) / 25


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("name", ALL)
def test_problems_run_and_stay_consistent(name, options):
    """Every problem for 30 steps on measurements near its own prediction: finite, symmetric, nonnegative."""
    if ", redraw: false" in options and name == "noise_inputs":
        options = options.replace(", redraw: false", "")
    kf = reference(loads(ALL[name].replace("type: kf", "type: ekf").replace("type: ekf", f"type: ukf, {options}")))
    rng = np.random.default_rng(3)
    u = np.full(len(kf.model.inputs), 0.2)
    run_time = kf.spec.dt.run_time
    for _ in range(8 if kf.model.n > 8 else 30):
        assert kf.predict(u if len(u) else None, 0.1 if run_time else None) == 0
        for sensor in kf.sensors.values():
            now = Context(kf.parameters, u, kf.t, 0.0)
            still = [0.0] * len(sensor.spec.noise)
            predicted = [float(v) for v in sensor.predict(list(kf.x), still, now, range(sensor.m))]
            z = np.array(predicted) + 0.01 * rng.normal(size=sensor.m)
            assert kf.update(sensor.name, z, u) & ~Status.GATED == 0
        assert np.array_equal(kf.P, kf.P.T)
        assert np.min(np.linalg.eigvalsh(kf.P)) > -1e-12 * np.max(kf.P)


@pytest.mark.parametrize("form", ["full", "sqrt"])
def test_forms_with_the_same_root_agree(form):
    """full, sqrt: one filter; ud has other points, and so differs from them where the model bends."""
    kfs = [
        reference(loads(ATT.replace("type: ekf", f"type: ukf, covariance: {c}, sigma_points: {{alpha: 0.5}}")))
        for c in ("full", form, "ud")
    ]
    rng = np.random.default_rng(4)
    for _ in range(10):
        u, z = 0.2 * rng.normal(size=3), np.array([0, 0, 9.81, 0.5, 0, 0.8]) + 0.05 * rng.normal(size=6)
        for kf in kfs:
            assert kf.predict(u) == 0
            assert kf.update("imu", z) == 0
    np.testing.assert_allclose(kfs[0].x, kfs[1].x, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(kfs[0].P, kfs[1].P, rtol=1e-9, atol=1e-12)
    assert 1e-9 < np.max(np.abs(kfs[0].x - kfs[2].x)) < 1e-2
