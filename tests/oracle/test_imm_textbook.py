"""Banks against the textbook: Blom & Bar-Shalom 1988 with plain matrices, and around single filters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from imm_banks import STRAIGHT, TURNING, HandBank, bank, build, singles
from scipy.stats import chi2, multivariate_normal

from kfgen.reference import Status, reference

DT = 0.3
TOP = f"""
kfgen: 1
name: three
scalar: double
dt: {DT}
states:
  p: {{init: 0, var: 1}}
  v: {{init: 1, var: 2}}
  a: {{init: 0, var: 0.5}}
covariances: [[p, v, 0.3]]
inputs: {{u: {{}}}}
dynamics:
  f: {{p: p + dt*v, v: v + u, a: 0.5*a}}
  Q: {{p: 0.01, v: 0.02, a: 0.03}}
measurements:
  position:
    z:
      z: {{h: p, var: 0.4}}
  both:
    z:
      z1: {{h: p + v}}
      z2: {{h: v - a}}
    R: [[0.5, 0.2], [0.2, 0.7]]
"""
MODES = {
    "slow": "filter: {type: kf}",
    "fast": """
states: {p: {init: -1, var: 2}, v: {init: 3, std: 1}, a: {init: 1, var: 1}}
noise: {jerk: {var: 0.5}}
dynamics:
  f: {p: p + dt*v + dt**2/2*a, v: v + dt*a, a: a + jerk}
  Q: {p: 0.001}
filter: {type: ekf, covariance: full}
""",
    "wild": """
P0: [[4, 1, 0], [1, 3, 0.5], [0, 0.5, 1]]
let: {half: v/2}
dynamics:
  f: {p: p + dt*half + 2*u, v: v + a}
  Q: [[0.3, 0.1, 0], [0.1, 0.2, 0], [0, 0, 0.1]]
measurements:
  position: {z: {z: {h: p + 0.5, var: 0.9}}}
  both: {z: {z1: {h: 2*p, var: 1}, z2: {h: half, var: 2}}}
filter: {type: ekf, covariance: sqrt}
""",
}
M = np.array([[0.9, 0.07, 0.03], [0.1, 0.8, 0.1], [0.0, 0.25, 0.75]])
MU0 = np.array([0.5, 0.3, 0.2])


def textbook():
    """The matrices of the three modes."""
    F = [
        np.array([[1, DT, 0], [0, 1, 0], [0, 0, 0.5]]),
        np.array([[1, DT, DT**2 / 2], [0, 1, DT], [0, 0, 1]]),
        np.array([[1, DT / 2, 0], [0, 1, 1], [0, 0, 1]]),
    ]
    B = [np.array([0.0, 1, 0]), np.zeros(3), np.array([2.0, 0, 0])]
    Q = [
        np.diag([0.01, 0.02, 0.03]),
        np.diag([0.001, 0, 0.5]),
        np.array([[0.3, 0.1, 0], [0.1, 0.2, 0], [0, 0, 0.1]]),
    ]
    common = {
        "position": (np.array([[1.0, 0, 0]]), np.zeros(1), np.array([[0.4]])),
        "both": (np.array([[1.0, 1, 0], [0, 1, -1]]), np.zeros(2), np.array([[0.5, 0.2], [0.2, 0.7]])),
    }
    own = {
        "position": (np.array([[1.0, 0, 0]]), np.array([0.5]), np.array([[0.9]])),
        "both": (np.array([[2.0, 0, 0], [0, 0.5, 0]]), np.zeros(2), np.diag([1.0, 2.0])),
    }
    P0 = np.array([[1, 0.3, 0], [0.3, 2, 0], [0, 0, 0.5]])
    # a mode with states of its own keeps the covariances of the top
    P1 = np.array([[2, 0.3, 0], [0.3, 1, 0], [0, 0, 1.0]])
    P2 = np.array([[4, 1, 0], [1, 3, 0.5], [0, 0.5, 1]])
    x = [np.array([0.0, 1, 0]), np.array([-1.0, 3, 1]), np.array([0.0, 1, 0])]
    return F, B, Q, [common, common, own], x, [P0, P1, P2]


@pytest.mark.parametrize("calls", ["pg", "pbg", "ppg", "gpppbbg", "bpgbppgg"])
def test_linear_bank_with_two_sensors(calls):
    """Calls: p a predict, g an update of `position`, b one of `both`, over and over."""
    kf = build(bank(TOP, MODES, M.tolist(), mu0=MU0.tolist()))
    F, B, Q, sensors, xs, Ps = textbook()
    mu, rng = MU0.copy(), np.random.default_rng(5)

    def same():
        x = sum(m * x for m, x in zip(mu, xs, strict=True))
        P = sum(m * (P + np.outer(x_i - x, x_i - x)) for m, x_i, P in zip(mu, xs, Ps, strict=True))
        np.testing.assert_allclose(kf.mu, mu, rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(kf.x, x, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(kf.P, P, rtol=1e-11, atol=1e-12)
        for mode, x_i, P_i in zip(kf.modes, xs, Ps, strict=True):
            np.testing.assert_allclose(mode.x, x_i, rtol=1e-11, atol=1e-12)
            np.testing.assert_allclose(mode.P, P_i, rtol=1e-11, atol=1e-12)

    same()
    for call in calls * 12:
        if call == "p":
            u = rng.normal(size=1)
            assert kf.predict(u) == 0
            c = M.T @ mu
            x0, P0 = [], []
            for j in range(3):
                w = M[:, j] * mu / c[j]
                x0.append(sum(w[i] * xs[i] for i in range(3)))
                P0.append(sum(w[i] * (Ps[i] + np.outer(xs[i] - x0[j], xs[i] - x0[j])) for i in range(3)))
            xs = [F[j] @ x0[j] + B[j] * u[0] for j in range(3)]
            Ps = [F[j] @ P0[j] @ F[j].T + Q[j] for j in range(3)]
            mu = c
        else:
            name = "position" if call == "g" else "both"
            z = 3.0 * rng.normal(size=len(sensors[0][name][1]))
            assert kf.update(name, z) == 0
            logs, nis = [], []
            for j in range(3):
                H, offset, R = sensors[j][name]
                y, S = z - H @ xs[j] - offset, H @ Ps[j] @ H.T + R
                K = Ps[j] @ H.T @ np.linalg.inv(S)
                logs.append(math.log(mu[j]) + multivariate_normal.logpdf(y, cov=S))
                nis.append(float(y @ np.linalg.inv(S) @ y))
                xs[j], Ps[j] = xs[j] + K @ y, (np.eye(3) - K @ H) @ Ps[j]
            mu = np.maximum(np.exp(np.array(logs) - np.logaddexp.reduce(logs)), 1e-9)
            mu = mu / mu.sum()
            assert kf.log_likelihood == pytest.approx(np.logaddexp.reduce(logs), rel=1e-10)
            assert kf.nis == pytest.approx(min(nis), rel=1e-10)
        same()


TYPES = [
    ("type: ekf", "type: ekf, covariance: full, update: standard"),
    ("type: ekf, covariance: sqrt", "type: ukf, covariance: full, sigma_points: {kind: julier, kappa: 1}"),
    ("type: ukf, covariance: sqrt", "type: iekf, iterations: 3"),
    ("type: ekf2", "type: ukf, sequential: true, sigma_points: {kind: cubature}"),
    ("type: ekf, robust: chernodarov", "type: ekf, covariance: full, adaptive: true"),
    ("type: ukf, adaptive: true", "type: ekf, consider: [w], update: joseph"),
]


@pytest.mark.parametrize("types", TYPES)
def test_mixed_banks_around_single_filters(types):
    """Every filter type in a bank with another: several updates between predicts, masks, inputs, an angle."""
    modes = {"turn": f"filter: {{{types[0]}}}", "straight": f"{STRAIGHT}noise: {{}}\nfilter: {{{types[1]}}}"}
    modes["calm"] = f"noise: {{nv: {{std: 0.01}}}}\nfilter: {{{types[0]}}}"
    transition = [[0.9, 0.06, 0.04], [0.05, 0.9, 0.05], [0.02, 0.08, 0.9]]
    text = bank(TURNING, modes, transition, mu0=[0.5, 0.3, 0.2])
    kf, hand = build(text), HandBank(text, transition, [0.5, 0.3, 0.2])
    rng, x, seen, chosen = np.random.default_rng(8), np.array([-30.0, 5, 4, 3.05, 0.2]), Status.OK, []
    for k in range(80):
        dt, u = 0.2 + 0.1 * (k % 3), [0.1]
        x = x + dt * np.array([x[2] * np.cos(x[3]), x[2] * np.sin(x[3]), u[0], x[4], 0])
        x[4] = 0.2 if k // 20 % 2 else -0.1
        status = kf.predict(u, dt)
        assert status == hand.predict(u, dt)
        assert_same(kf, hand)
        z = np.array([np.hypot(*x[:2]), np.arctan2(x[1], x[0])]) + rng.normal(size=2) * [0.5, 0.02]
        if k % 17 == 16:
            z[0] += 6.0
        if k % 3 == 0:
            seen |= Status(status := kf.update("radar", z))
            assert status == hand.update("radar", z)
            assert_same(kf, hand)
        if k % 4 < 2:
            g = x[:3] + rng.normal(size=3) * [1, 1, 0.3]
            mask = (0b111, 0b101)[k % 2]
            seen |= Status(status := kf.update("gnss", g, mask=mask))
            assert status == hand.update("gnss", g, mask=mask)
            assert_same(kf, hand)
            assert kf.log_likelihood == pytest.approx(hand.log_likelihood, rel=1e-7)
            assert kf.nis == pytest.approx(hand.nis, rel=1e-6, abs=1e-9)
        chosen.append(np.argmax(kf.mu))
    assert len(set(chosen)) > 1
    assert bool(seen & (Status.ANOMALY | Status.GLITCH_SMALL | Status.GLITCH_LARGE)) == (
        "adaptive" in "".join(types) or "robust" in "".join(types)
    )


def assert_same(kf, hand):
    np.testing.assert_allclose(kf.mu, hand.mu, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(kf.x, hand.x, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(kf.P, hand.P, rtol=1e-7, atol=1e-8)
    for mode, other in zip(kf.modes, hand.filters, strict=True):
        np.testing.assert_allclose(mode.x, other.x, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(mode.P, other.P, rtol=1e-7, atol=1e-8)


def test_a_bank_of_a_jump_process_is_consistent():
    """A process that switches as the bank supposes: errors as large as P says, probabilities that mean what
    they say, and a higher likelihood than any one mode's."""
    top = """
kfgen: 1
name: jump
scalar: double
dt: 1
states: {p: {init: 0, var: 4}, v: {init: 0, var: 1}}
measurements: {s: {z: {z: {h: p, var: 1}}}}
"""
    calm, wild = "{p: p + v, v: v}", "{p: p + v, v: 0.8*v}"
    modes = {
        "calm": f"dynamics: {{f: {calm}, Q: {{v: 0.01}}}}",
        "wild": f"dynamics: {{f: {wild}, Q: {{v: 4}}}}",
    }
    transition = [[0.95, 0.05], [0.1, 0.9]]
    text = bank(top, modes, transition, mu0=[0.6, 0.4])
    kf, alone = build(text), [reference(spec) for spec in singles(text)]
    rng, hits, nees, gain = np.random.default_rng(2), [], [], np.zeros(2)
    for run in range(30):
        filters = [kf, *alone] if run < 15 else [kf]
        mode, x = int(rng.random() > 0.6), rng.normal(size=2) * [2, 1]
        total = np.zeros(3)
        for each in filters:
            each.init()
        for _ in range(60):
            mode = int(rng.random() > transition[mode][0])
            x = np.array([x[0] + x[1], (1.0, 0.8)[mode] * x[1] + (0.1, 2.0)[mode] * rng.normal()])
            z = x[:1] + rng.normal(size=1)
            for i, each in enumerate(filters):
                assert each.predict() == each.update("s", z) == 0
                total[i] += each.log_likelihood
            nees.append((kf.x - x) @ np.linalg.solve(kf.P, kf.x - x))
            hits.append((kf.mu[1], mode))
        if run < 15:
            gain += total[0] - total[1:]
    assert np.mean(nees) == pytest.approx(2.0, abs=0.2)
    assert np.mean(np.array(nees) < chi2.ppf(0.95, 2)) == pytest.approx(0.94, abs=0.03)
    likely, truth = np.array(hits).T
    for low in (0.0, 0.25, 0.5, 0.75):
        some = (likely >= low) & (likely < low + 0.25)
        assert np.mean(truth[some]) == pytest.approx(np.mean(likely[some]), abs=0.08)
    assert np.all(gain > 100.0)
