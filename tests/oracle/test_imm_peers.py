"""Banks against results of other implementations, and against filterpy where it is right."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from imm_banks import build
from problems import IMM3
from test_filterpy import random_covariance, rows
from test_peers import read


def imm3(cv: str, ca: str) -> str:
    """imm3 with the options of its two filters."""
    first, second, rest = IMM3.split("{type: ekf}")
    return f"{first}{{{cv}}}{second}{{{ca}}}{rest}"


BIERMAN, UKF = "type: ekf", "type: ukf, covariance: ud, sequential: false"
KAPPA0 = "sigma_points: {kind: julier, kappa: 0, redraw: false}"


@pytest.mark.parametrize(
    ("cv", "ca", "peer"),
    [
        (BIERMAN, BIERMAN, "filterpy_imm3_imm"),
        ("type: kf, update: joseph", "type: ekf, covariance: full", "yafl_imm3_imm_bierman"),
        ("type: ekf, covariance: sqrt", "type: iekf, iterations: 2", "filterpy_imm3_imm"),
        ("type: ekf2, covariance: full, update: standard", "type: ukf, covariance: sqrt", "filterpy_imm3_imm"),
        (BIERMAN, f"{UKF}, {KAPPA0}", "yafl_imm3_imm_ekf_ukf_kappa0"),
    ],
)
def test_peer(cv, ca, peer):
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj), mu: 1e-8."""
    kf = build(imm3(cv, ca))
    result = {int(row[0]): row[1:] for row in read(peer)}
    largest = np.max(np.abs([row[:3] for row in result.values()]), axis=0)
    error_x = error_P = error_mu = 0.0
    for row, z in enumerate(read("in_imm3")):
        assert kf.predict() == 0
        assert kf.update("position", z) == 0
        if row not in result:
            continue
        x, P, mu = result[row][:3], result[row][3:12].reshape(3, 3), result[row][12:]
        scale = np.sqrt(np.outer(P.diagonal(), P.diagonal()))
        error_x = max(error_x, np.max(np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest)))
        error_P = max(error_P, np.max(np.abs(kf.P - P) / scale))
        error_mu = max(error_mu, np.max(np.abs(kf.mu - mu)))
    assert error_x < 1e-8
    assert error_P < 1e-8
    assert error_mu < 1e-8


def filterpy_spec(filters, M, mu) -> str:
    n, m = filters[0].H.shape[::-1]
    f = [
        ", ".join(f'x{i}: "' + " + ".join(f"({kf.F[i, j]!r})*x{j}" for j in range(n)) + '"' for i in range(n))
        for kf in filters
    ]
    z = [
        ", ".join(f'z{k}: {{h: "' + " + ".join(f"({kf.H[k, j]!r})*x{j}" for j in range(n)) + '"}' for k in range(m))
        for kf in filters
    ]
    lines = ["kfgen: 1", "name: peer", "scalar: double", "dt: 1", "states:"]
    lines += [f"  x{i}: {{init: 0, var: 1}}" for i in range(n)]
    lines += ["imm:", "  modes:"]
    for b, kf in enumerate(filters):
        init = ", ".join(f"x{i}: {{init: {kf.x[i]!r}}}" for i in range(n))
        lines += [
            f"    m{b}:", f"      states: {{{init}}}", f"      P0: {rows(kf.P)}",
            "      dynamics:", f"        f: {{{f[b]}}}", f"        Q: {rows(kf.Q)}",
            "      measurements:", "        s:", f"          z: {{{z[b]}}}", f"          R: {rows(kf.R)}",
            f"      filter: {{type: kf, covariance: {('ud', 'full', 'sqrt')[b % 3]}}}",
        ]  # fmt: skip
    lines += [f"  transition: {rows(M)}", f"  mu0: {mu.tolist()}", "  mu_floor: 0"]
    return "\n".join(lines).replace("np.float64", "") + "\n"


@pytest.mark.parametrize("seed", range(8))
def test_random_linear_banks(seed):
    """filterpy's bank is right where predict and update alternate, once the first predict has been given the
    mixing that it makes at its construction; after a predict its x and P are weighed with the old mu."""
    rng = np.random.default_rng(seed)
    n, m, size = int(rng.integers(1, 5)), int(rng.integers(1, 4)), int(rng.integers(2, 9))
    filters = []
    for _ in range(size):
        kf = KalmanFilter(dim_x=n, dim_z=m)
        kf.F = np.eye(n) + 0.1 * rng.normal(size=(n, n))
        kf.F /= max(1.0, np.max(np.abs(np.linalg.eigvals(kf.F))))
        kf.H, kf.x = rng.normal(size=(m, n)), rng.normal(size=n)
        kf.Q = np.round(random_covariance(rng, n), 12) + 1e-3 * np.eye(n)
        kf.R = np.round(random_covariance(rng, m), 12) + 0.5 * np.eye(m)
        kf.P = np.round(random_covariance(rng, n), 12) + 1e-3 * np.eye(n)
        filters.append(kf)
    M, mu = rng.dirichlet(np.ones(size), size=size), rng.dirichlet(np.ones(size))
    kf, peer = build(filterpy_spec(filters, M, mu)), IMMEstimator(filters, mu, M)
    np.testing.assert_allclose(kf.x, peer.x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(kf.P, peer.P, rtol=1e-12, atol=1e-12)
    for _ in range(25):
        z = 2.0 * rng.normal(size=m)
        assert kf.predict() == 0
        peer.predict()
        np.testing.assert_allclose(kf.mu, peer.cbar, rtol=1e-9, atol=1e-12)
        assert kf.update("s", z) == 0
        peer.update(z)
        np.testing.assert_allclose(kf.mu, peer.mu, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(kf.x, peer.x, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(kf.P, peer.P, rtol=1e-8, atol=1e-9)
        for mode, other in zip(kf.modes, peer.filters, strict=True):
            np.testing.assert_allclose(mode.x, other.x, rtol=1e-8, atol=1e-9)
            np.testing.assert_allclose(mode.P, other.P, rtol=1e-8, atol=1e-9)
