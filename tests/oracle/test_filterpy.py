"""filterpy as a second oracle, on random linear problems and on a nonlinear one."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter
from problems import RADAR

from kfgen.reference import reference
from kfgen.reference.model import wrap
from kfgen.spec import loads


def rows(matrix: np.ndarray) -> str:
    return "[" + ", ".join("[" + ", ".join(repr(float(v)) for v in row) + "]" for row in matrix) + "]"


def random_covariance(rng: np.random.Generator, n: int, rank: int | None = None) -> np.ndarray:
    root = rng.normal(size=(n, rank or n))
    return root @ root.T


def linear_spec(F, B, Q, H, R, P0, x0) -> str:
    n, m, nu = len(F), len(H), B.shape[1]
    f = [
        f"    x{i}: " + " + ".join([f"({float(F[i, j])!r})*x{j}" for j in range(n)]
                                  + [f"({float(B[i, j])!r})*u{j}" for j in range(nu)])
        for i in range(n)
    ]  # fmt: skip
    h = [
        f"      z{i}: {{h: " + " + ".join(f"({float(H[i, j])!r})*x{j}" for j in range(n)) + "}"
        for i in range(m)
    ]
    lines = [
        "kfgen: 1", "name: linear", "scalar: double", "dt: 0.1", "states:",
        *(f"  x{i}: {{init: {float(x0[i])!r}}}" for i in range(n)), f"P0: {rows(P0)}",
        "inputs:", *(f"  u{i}: {{}}" for i in range(nu)),
        "dynamics:", "  form: discrete", "  f:", *f, f"  Q: {rows(Q)}",
        "measurements:", "  s:", "    z:", *h, f"    R: {rows(R)}",
        "filter: {type: kf}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("seed", range(12))
def test_random_linear(seed):
    rng = np.random.default_rng(seed)
    n, m, nu = rng.integers(1, 7), rng.integers(1, 5), rng.integers(1, 3)
    F = np.eye(n) + 0.2 * rng.normal(size=(n, n))
    F /= max(1.0, np.max(np.abs(np.linalg.eigvals(F))))
    B, H = rng.normal(size=(n, nu)), rng.normal(size=(m, n))
    Q, R = random_covariance(rng, n, rank=1 + n // 2), random_covariance(rng, m) + 0.1 * np.eye(m)
    P0, x0 = random_covariance(rng, n), rng.normal(size=n)
    Q, R, P0 = (np.round((A + A.T) / 2, 12) for A in (Q, R, P0))
    Q += 1e-9 * np.eye(n)
    P0 += 1e-9 * np.eye(n)

    kf = reference(loads(linear_spec(F, B, Q, H, R, P0, x0)))
    peer = KalmanFilter(dim_x=n, dim_z=m, dim_u=nu)
    peer.x, peer.P, peer.F, peer.B, peer.Q, peer.H, peer.R = x0.copy(), P0.copy(), F, B, Q, H, R
    for _ in range(60):
        u, z = rng.normal(size=nu), rng.normal(size=m)
        assert kf.predict(u) == 0
        peer.predict(u)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-10, atol=1e-11)
        assert kf.update("s", z) == 0
        peer.update(z)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-10)
        assert kf.nis == pytest.approx(float(peer.y @ peer.SI @ peer.y), rel=1e-9)
        assert kf.log_likelihood == pytest.approx(float(peer.log_likelihood), rel=1e-9, abs=1e-9)


def test_radar_with_a_wrapping_bearing():
    """Range and bearing of a target that crosses the negative x axis, where the bearing jumps by 2 pi."""
    kf = reference(loads(RADAR.replace("    gate: {probability: 0.9999}\n", "")))
    peer = ExtendedKalmanFilter(dim_x=4, dim_z=2)
    peer.x, peer.P = np.array([-100.0, 20.0, 0.0, -5.0]), np.diag([100.0, 100.0, 25.0, 25.0])
    peer.F = np.eye(4) + 0.5 * np.eye(4, k=2)
    peer.Q, peer.R = np.diag([0.0, 0.0, 0.25, 0.25]), np.diag([4.0, 4e-4])

    def h(x):
        return np.array([np.hypot(x[0], x[1]), np.arctan2(x[1], x[0])])

    def H(x):
        r = np.hypot(x[0], x[1])
        return np.array([[x[0] / r, x[1] / r, 0, 0], [-x[1] / r**2, x[0] / r**2, 0, 0]])

    def residual(a, b):
        return np.array([a[0] - b[0], (a[1] - b[1] + np.pi) % (2 * np.pi) - np.pi])

    rng = np.random.default_rng(1)
    truth = np.array([-95.0, 25.0, 0.5, -4.0])
    crossings = 0
    for _ in range(60):
        truth = peer.F @ truth
        z = h(truth) + rng.normal(size=2) * [2.0, 0.02]
        z[1] = wrap(float(z[1]), 2 * np.pi)
        assert kf.predict() == 0
        peer.predict()
        crossings += abs(z[1] - h(peer.x)[1]) > np.pi
        assert kf.update("radar", z) == 0
        peer.update(z, H, h, residual=residual)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-9, atol=1e-9)
    assert crossings >= 1
    assert np.linalg.norm(kf.x[:2] - truth[:2]) < 6.0
