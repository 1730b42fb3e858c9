"""Sigma-point filters against results of other implementations, and against filterpy where it is right."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import (
    CubatureKalmanFilter,
    JulierSigmaPoints,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)
from problems import RADAR, VEHICLE4, chain
from test_peers import read

from kfgen.reference import reference
from kfgen.reference.model import wrap
from kfgen.spec import loads

MERWE = "sigma_points: {kind: merwe, alpha: 0.1, beta: 2, kappa: 1"


@pytest.mark.parametrize(
    ("options", "peer"),
    [
        (f"covariance: full, {MERWE}}}", "filterpy_vehicle4_ukf"),
        (f"covariance: sqrt, {MERWE}}}", "filterpy_vehicle4_ukf"),
        (f"covariance: full, {MERWE}, redraw: false}}", "filterpy_vehicle4_ukf"),
        (f"{MERWE}, redraw: false}}", "yafl_vehicle4_ukf_full"),
        (f"{MERWE}}}", "yafl_vehicle4_ukf_full"),
        (f"adaptive: {{probability: 0.999}}, {MERWE}, redraw: false}}", "yafl_vehicle4_ukf_adaptive"),
        ("sigma_points: {kind: julier, kappa: 1, redraw: false}", "yafl_vehicle4_ukf_full_julier"),
    ],
)
def test_peer(options, peer):
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj): 1e-8."""
    kf = reference(loads(VEHICLE4.replace("type: ekf", f"type: ukf, {options}")))
    result = {int(row[0]): row[1:] for row in read(peer)}
    largest = np.max(np.abs([row[:4] for row in result.values()]), axis=0)
    error_x = error_P = 0.0
    for row, z in enumerate(read("in_vehicle4")):
        assert kf.predict() == 0
        assert kf.update("gnss", z) == 0
        if row not in result:
            continue
        x, P = result[row][:4], result[row][4:].reshape(4, 4)
        scale = np.sqrt(np.outer(P.diagonal(), P.diagonal()))
        error_x = max(error_x, np.max(np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest)))
        error_P = max(error_P, np.max(np.abs(kf.P - P) / scale))
    assert error_x < 1e-8
    assert error_P < 1e-8


def chain_step(x, dt):
    p, v = x[:2], x[2:]
    a = -p + 0.3 * (np.array([p[1], p[0]]) - 2.0 * p) - 0.05 * v - 0.1 * p**3
    return np.concatenate([p + dt * v, v + dt * a])


def chain_peer(points) -> UnscentedKalmanFilter:
    peer = UnscentedKalmanFilter(4, 1, 0.05, hx=lambda x: x[:1], fx=chain_step, points=points)
    peer.x, peer.P = np.array([0.1, 0.1, 0.0, 0.0]), np.eye(4)
    peer.Q, peer.R = np.diag([1e-6, 1e-6, 1e-4, 1e-4]), np.array([[0.01]])
    return peer


@pytest.mark.parametrize(
    ("kind", "points"),
    [
        ("{kind: merwe, alpha: 0.5, beta: 2, kappa: -1}", MerweScaledSigmaPoints(4, 0.5, 2.0, -1.0)),
        ("{kind: julier, kappa: 0.5}", JulierSigmaPoints(4, 0.5)),
    ],
)
@pytest.mark.parametrize("form", ["full", "sqrt"])
def test_chain(kind, points, form):
    text = chain(4).replace("type: ekf", f"type: ukf, covariance: {form}, sigma_points: {kind}")
    kf, peer, rng = reference(loads(text)), chain_peer(points), np.random.default_rng(4)
    truth = np.array([1.0, -1.0, 0.5, 2.0])
    for _ in range(150):
        truth = chain_step(truth, 0.05)
        z = truth[:1] + 0.1 * rng.normal(size=1)
        assert kf.predict() == 0
        peer.predict()
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-9)
        assert kf.update("position", z) == 0
        peer.update(z)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-9)
        assert kf.nis == pytest.approx(float(peer.y @ np.linalg.solve(peer.S, peer.y)), rel=1e-8)
        assert kf.log_likelihood == pytest.approx(float(peer.log_likelihood), rel=1e-8, abs=1e-8)


def test_cubature_without_redraw():
    """filterpy's cubature filter keeps its points from predict to update."""
    text = chain(4).replace("type: ekf", "type: ukf, covariance: full, sigma_points: {kind: cubature, redraw: false}")
    kf, rng = reference(loads(text)), np.random.default_rng(4)
    peer = CubatureKalmanFilter(4, 1, 0.05, hx=lambda x: x[:1], fx=chain_step)
    peer.x, peer.P = np.array([0.1, 0.1, 0.0, 0.0]), np.eye(4)
    peer.Q, peer.R = np.diag([1e-6, 1e-6, 1e-4, 1e-4]), np.array([[0.01]])
    for _ in range(150):
        z = 0.5 * rng.normal(size=1)
        assert kf.predict() == 0
        peer.predict()
        assert kf.update("position", z) == 0
        peer.update(z[:, None])
        np.testing.assert_allclose(kf.x, peer.x.ravel(), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("form", ["full", "sqrt"])
def test_radar_with_a_wrapping_bearing(form):
    """A target that crosses the negative x axis, where the bearings of its points jump by 2 pi."""
    options = "sigma_points: {kind: merwe, alpha: 0.5, beta: 2, kappa: 0}"
    text = RADAR.replace("    gate: {probability: 0.9999}\n", "")
    kf = reference(loads(text.replace("type: ekf", f"type: ukf, covariance: {form}, {options}")))

    def h(x):
        return np.array([np.hypot(x[0], x[1]), np.arctan2(x[1], x[0])])

    def difference(a, b):
        d = np.subtract(a, b)
        return np.array([d[0], wrap(float(d[1]), 2 * np.pi)])

    def mean(points, weights):
        return points[0] + weights @ np.array([difference(p, points[0]) for p in points])

    F = np.eye(4) + 0.5 * np.eye(4, k=2)
    peer = UnscentedKalmanFilter(
        4, 2, 0.5, hx=h, fx=lambda x, dt: F @ x, points=MerweScaledSigmaPoints(4, 0.5, 2.0, 0.0),
        z_mean_fn=mean, residual_z=difference,
    )  # fmt: skip
    peer.x, peer.P = np.array([-100.0, 20.0, 0.0, -5.0]), np.diag([100.0, 100.0, 25.0, 25.0])
    peer.Q, peer.R = np.diag([0.0, 0.0, 0.25, 0.25]), np.diag([4.0, 4e-4])
    rng, truth, crossings = np.random.default_rng(1), np.array([-95.0, 25.0, 0.5, -4.0]), 0
    for _ in range(60):
        truth = F @ truth
        z = h(truth) + rng.normal(size=2) * [2.0, 0.02]
        z[1] = wrap(float(z[1]), 2 * np.pi)
        assert kf.predict() == 0
        peer.predict()
        bearings = [h(p)[1] for p in peer.sigmas_f]
        crossings += max(bearings) - min(bearings) > np.pi
        assert kf.update("radar", z) == 0
        peer.update(z)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-9)
    assert crossings >= 1
    assert np.linalg.norm(kf.x[:2] - truth[:2]) < 6.0
