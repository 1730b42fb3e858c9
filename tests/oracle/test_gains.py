"""Gains that are not the optimal ones: considered states, limited gains, a floor of the innovation variance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import one_state

from kfgen.reference import Status, reference
from kfgen.spec import loads

JOSEPH = ["ud, update: joseph", "full"]
FORMS = [*JOSEPH, "ud", "full, update: standard", "sqrt"]

# a position and velocity, with a bias of the first of two correlated sensors
BIASED = """
kfgen: 1
name: biased
scalar: double
dt: 0.5
states:
  p: {init: 0, var: 4}
  v: {init: 1, var: 1}
  b: {init: 0, var: 0.5}
covariances: [[p, b, 0.3]]
dynamics:
  form: discrete
  f: {p: p + dt*v}
  Q: {p: 0.01, v: 0.1}
measurements:
  s:
    z:
      u: {h: p + b}
      w: {h: 2*p - v}
    R: [[0.5, 0.3], [0.3, 1]]
filter: {type: kf}
"""
F = np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
Q = np.diag([0.01, 0.1, 0.0])
H = np.array([[1.0, 0.0, 1.0], [2.0, -1.0, 0.0]])
R = np.array([[0.5, 0.3], [0.3, 1.0]])


def build(text: str):
    return reference(loads(text))


def biased(options: str, kind: str = "kf"):
    return build(BIASED.replace("type: kf", f"type: {kind}{options}"))


def decorrelated(y):
    """Rows of H, variances, innovations of R = U D U^T."""
    U = np.array([[1.0, 0.3], [0.0, 1.0]])
    return np.linalg.inv(U) @ H, [0.5 - 0.09, 1.0], np.linalg.inv(U) @ y


def joseph(P, K, h, r):
    A = np.eye(3) - np.outer(K, h)
    return A @ P @ A.T + r * np.outer(K, K)


@pytest.mark.parametrize("form", JOSEPH)
@pytest.mark.parametrize("kind", ["kf", "ekf", "ekf2", "iekf, iterations: 3"])
def test_considered_state(form, kind):
    """Schmidt's filter, scalar by scalar, in the partitioned form of its textbooks."""
    kf = biased(f", covariance: {form}, consider: [b]", kind)
    rng = np.random.default_rng(2)
    x, P = kf.x, kf.P
    for _ in range(20):
        assert kf.predict() == 0
        x, P = F @ x, F @ P @ F.T + Q
        z = rng.normal(size=2) * 3.0
        S = H @ P @ H.T + R
        assert kf.update("s", z) == 0
        assert kf.nis == pytest.approx((z - H @ x) @ np.linalg.solve(S, z - H @ x), rel=1e-10)
        rows, variances, y = decorrelated(z - H @ x)
        dx, likelihood = np.zeros(3), 0.0
        for h, r, full in zip(rows, variances, y, strict=True):
            s = r + h @ P @ h
            K = P @ h / s
            nu = full - h @ dx
            # P_xx - K s K^T, P_xb - K h P_.b, P_bb as it is (Schmidt 1966)
            cross = P[:2, 2] - K[:2] * (h @ P[:, 2])
            P = P - s * np.outer(K, K)
            P[:2, 2] = P[2, :2] = cross
            P[2, 2] = 0.5
            dx[:2] += K[:2] * nu
            likelihood -= 0.5 * (math.log(2 * math.pi) + nu**2 / s + math.log(s))
        x = x + dx
        np.testing.assert_allclose(kf.x, x, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(kf.P, P, rtol=1e-10, atol=1e-12)
        assert kf.log_likelihood == pytest.approx(likelihood, rel=1e-10)
    assert kf.x[2] == 0.0
    assert kf.P[2, 2] == pytest.approx(0.5, rel=1e-13)


def test_considering_is_worse_than_estimating_and_better_than_forgetting():
    considered, estimated = biased(", update: joseph, consider: [b]"), biased("")
    forgotten = build(BIASED.replace("b: {init: 0, var: 0.5}", "b: {init: 0, var: 0}").replace("[[p, b, 0.3]]", "[]"))
    for _ in range(30):
        for kf in (considered, estimated, forgotten):
            kf.predict()
            kf.update("s", [0.0, 0.0])
    assert forgotten.P[0, 0] < estimated.P[0, 0] < considered.P[0, 0]


@pytest.mark.parametrize("form", JOSEPH)
@pytest.mark.parametrize("robust", [False, True])
def test_limited_gain(form, robust):
    options = f", covariance: {form}, gain_limit: 0.25" + (", robust: chernodarov" if robust else "")
    kf = biased(options)
    rng = np.random.default_rng(3)
    limited = False
    for _ in range(15):
        kf.predict()
        x, P = kf.x, kf.P
        z = H @ x + rng.normal(size=2) * 2.0
        rows, variances, y = decorrelated(z - H @ x)
        dx, expected = np.zeros(3), Status.OK
        for h, r, full in zip(rows, variances, y, strict=True):
            nu, g = full - h @ dx, 1.0
            if robust:
                e = nu / math.sqrt(r)
                g = 1.0 if abs(e) <= 3 else 1 / 3 if abs(e) <= 6 else 0.0
                nu = nu if abs(e) <= 3 else nu / 3 if abs(e) <= 6 else math.copysign(math.sqrt(r), e)
                expected |= {1.0: Status.OK, 0.0: Status.GLITCH_LARGE}.get(g, Status.GLITCH_SMALL)
            K = P @ h / (r + g * h @ P @ h)
            if np.any(np.abs(K) > 0.25):
                limited, expected = True, expected | Status.REGULARIZED
            K = np.clip(K, -0.25, 0.25)
            A = np.eye(3) - g * np.outer(K, h)
            P = A @ P @ A.T + g * r * np.outer(K, K)
            dx += K * nu
        assert kf.update("s", z) == expected
        np.testing.assert_allclose(kf.x, x + dx, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(kf.P, P, rtol=1e-10, atol=1e-12)
        assert np.min(np.linalg.eigvalsh(kf.P)) > 0
    assert limited


def test_a_wide_limit_and_a_low_floor_change_nothing():
    plain, other = biased(""), biased(", update: joseph, gain_limit: 100, innovation_floor: 1e-9")
    for z in np.random.default_rng(6).normal(size=(20, 2)):
        for kf in (plain, other):
            kf.predict()
            assert kf.update("s", z) == 0
        np.testing.assert_allclose(other.x, plain.x, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(other.P, plain.P, rtol=1e-11, atol=1e-13)
        assert other.nis == pytest.approx(plain.nis, rel=1e-11)
        assert other.log_likelihood == pytest.approx(plain.log_likelihood, rel=1e-11)


def one(options: str, r: str, second: str = "", kind: str = "ekf"):
    text = one_state("  form: discrete\n  f: {x: x}", z=f"{{h: x, var: {r}}}{second}")
    return build(text.replace("{type: ekf}", f"{{type: {kind}{options}}}"))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["kf", "ekf", "ekf2", "iekf, iterations: 2"])
def test_innovation_floor(form, kind):
    """s = 0.5 + 0.1 is raised to 2: r becomes 1.5."""
    kf = one(f", covariance: {form}, innovation_floor: 2", "0.1", kind=kind)
    assert kf.update("s", [3.0]) == Status.REGULARIZED
    assert kf.x[0] == pytest.approx(1.0 + 0.25 * 2.0)
    assert kf.P[0, 0] == pytest.approx(0.5 - 0.5**2 / 2.0)
    assert kf.nis == pytest.approx(4.0 / 2.0)
    assert kf.log_likelihood == pytest.approx(-0.5 * (math.log(2 * math.pi) + 2.0 + math.log(2.0)))


def test_the_floor_is_there_for_exact_sensors():
    """Two exact sensors that say the same: without a floor the second is skipped, with it it counts."""
    kf = one(", innovation_floor: 0.01", "0", "\n      z2: {h: x, var: 0}")
    assert kf.update("s", [2.0, 3.0]) == Status.REGULARIZED
    assert (kf.x[0], kf.P[0, 0]) == (2.0, 0.0)
    assert kf.nis == pytest.approx(1.0 / 0.5 + 1.0 / 0.01)
    kf.set_covariance([[0.0]])
    assert kf.update("s", [2.0, 2.0]) == Status.REGULARIZED
    assert kf.nis == 0.0


def test_the_floor_comes_after_robust_and_adaptive():
    kf = one(", innovation_floor: 100, robust: chernodarov, adaptive: {chi2: 0.1}", "1")
    nu, s = 2.5, 62.5  # inflated until s = 2.5^2 / 0.1
    assert kf.update("s", [1.0 + nu]) == Status.REGULARIZED | Status.ANOMALY
    c = s - 1.0
    assert kf.x[0] == pytest.approx(1.0 + c / 100.0 * nu)
    assert kf.P[0, 0] == pytest.approx(c - c * c / 100.0)
    assert kf.nis == pytest.approx(nu**2 / 100.0)  # the plain s = 1.5 meets the floor as well
    kf.init()
    assert kf.update("s", [1.0 + 4.0]) == Status.REGULARIZED | Status.ANOMALY | Status.GLITCH_SMALL
    nu, g = 4.0 / 3.0, 1.0 / 3.0
    s = g * nu**2 / 0.1
    c = (s - 1.0) / g
    assert kf.x[0] == pytest.approx(1.0 + c / 100.0 * nu)
    assert kf.P[0, 0] == pytest.approx(c - g * c * c / 100.0)


def test_a_gate_judges_by_the_floored_variance():
    gate = "\n    gate: {probability: 0.99}"
    assert one("", "0.1", gate).update("s", [4.0]) == Status.GATED  # 9 / 0.6
    assert one(", innovation_floor: 2", "0.1", gate).update("s", [4.0]) == Status.REGULARIZED  # 9 / 2


@pytest.mark.parametrize("option", ["consider: [y]", "gain_limit: 0.1", "innovation_floor: 3"])
def test_semidefinite(option):
    """A prior of rank 1, an exact sensor and a repeated one: P stays a covariance."""
    z = "{h: x, var: 0}\n      z2: {h: x, var: 1}\n      z3: {h: x + y, var: 1}"
    text = one_state("  form: discrete\n  f: {x: x + y}", z=z, states="  y: {init: 0, var: 0}")
    kf = build(text.replace("{type: ekf}", f"{{type: ekf, update: joseph, {option}}}"))
    assert kf.set_covariance([[4.0, 2.0], [2.0, 1.0]]) == 0
    for k in range(6):
        assert kf.update("s", [2.0, 2.0 + k, 3.0]) < Status.ERROR
        assert np.min(np.linalg.eigvalsh(kf.P)) >= -1e-15
        assert kf.predict() == 0
    assert np.all(np.isfinite(kf.x))
