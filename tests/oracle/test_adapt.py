"""adapt_R and adapt_Q against a dense recomputation, and what leaves them alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import one_state

from kfgen.reference import Status, reference
from kfgen.reference.model import wrap
from kfgen.spec import loads

FORMS = ["ud", "ud, update: joseph", "full", "full, update: standard", "sqrt"]

# a slowly turning point: range and bearing with noise in the range's scale, and its position, correlated
TURNING = """
kfgen: 1
name: turning
scalar: double
dt: 0.1
states:
  x: {init: -8, var: 0.5}
  y: {init: 0.3, var: 0.5}
  w: {init: 0.2, var: 0.1}
noise: {turn: {std: 0.02}}
dynamics:
  form: discrete
  f: {x: x - dt*w*y, y: y + dt*w*x, w: w + turn}
  Q: [[0.01, 0.002, 0], [0.002, 0.01, 0], [0, 0, 1e-4]]
measurements:
  radar:
    z:
      range: {h: "hypot(x, y)*(1 + scale)", std: 0.1}
      bearing: {h: "atan2(y, x)", std: 0.02, kind: angle}
    noise: {scale: {std: 0.01}}
  fix:
    z:
      px: {h: x}
      py: {h: y}
      speed: {h: "w*hypot(x, y)"}
    R: [[0.09, 0.02, 0], [0.02, 0.09, 0.01], [0, 0.01, 0.25]]
    partial: true
filter: {type: ekf}
"""
A, B = 0.1, 0.2
R_RADAR = np.diag([0.01, 4e-4])
R_FIX = np.array([[0.09, 0.02, 0], [0.02, 0.09, 0.01], [0, 0.01, 0.25]])
Q_OWN = np.array([[0.01, 0.002, 0], [0.002, 0.01, 0], [0, 0, 1e-4]])


def build(text: str):
    return reference(loads(text))


def turning(options: str, kind: str = "ekf"):
    return build(TURNING.replace("type: ekf", f"type: {kind}{options}"))


def model(sensor, x):
    """h, H and dh/dscale."""
    r, w = math.hypot(x[0], x[1]), x[2]
    if sensor == "radar":
        h = np.array([r, math.atan2(x[1], x[0])])
        H = np.array([[x[0] / r, x[1] / r, 0], [-x[1] / r**2, x[0] / r**2, 0]])
        return h, H, np.array([r, 0.0])
    h = np.array([x[0], x[1], w * r])
    return h, np.array([[1, 0, 0], [0, 1, 0], [w * x[0] / r, w * x[1] / r, r]]), np.zeros(3)


def residual(sensor, z, x):
    d = z - model(sensor, x)[0]
    if sensor == "radar":
        d[1] = wrap(float(d[1]), 2 * math.pi)
    return d


class Dense:
    """The filter and its adaptation, written down once more."""

    def __init__(self, a: float, b: float) -> None:
        self.x, self.P, self.a, self.b = np.array([-8.0, 0.3, 0.2]), np.diag([0.5, 0.5, 0.1]), a, b
        self.R = {"radar": R_RADAR.copy(), "fix": R_FIX.copy()}
        self.e = {"radar": np.zeros(2), "fix": np.zeros(3)}
        self.Q = Q_OWN.copy()

    def predict(self) -> None:
        x, y, w = self.x
        F = np.array([[1, -0.1 * w, -0.1 * y], [0.1 * w, 1, 0.1 * x], [0, 0, 1]])
        self.x = np.array([x - 0.1 * w * y, y + 0.1 * w * x, w])
        self.P = F @ self.P @ F.T + self.Q + np.diag([0, 0, 4e-4])

    def update(self, sensor, z, used) -> float:
        H, M = (part[used] for part in model(sensor, self.x)[1:])
        y, e, R, a = residual(sensor, z, self.x)[used], self.e[sensor], self.R[sensor], self.a
        m = len(R)
        for i in range(m):
            for j in range(m):
                if i in used and j in used:
                    k, n = used.index(i), used.index(j)
                    R[i, j] = (1 - a) * R[i, j] + a * ((H @ self.P @ H.T)[k, n] + e[i] * e[j])
                elif i in used or j in used:
                    R[i, j] *= 1 - a
        part = R[np.ix_(used, used)] + 1e-4 * np.outer(M, M)
        S = H @ self.P @ H.T + part
        U, D = unit_upper(part)
        rows, innovations, dx = np.linalg.inv(U) @ H, np.linalg.inv(U) @ y, np.zeros(3)
        outer = np.zeros((3, 3))
        for row, r, full in zip(rows, D, innovations, strict=True):
            K = self.P @ row / (r + row @ self.P @ row)
            step = K * (full - row @ dx)
            self.P = self.P - np.outer(K, row @ self.P)
            dx, outer = dx + step, outer + np.outer(step, step)
        self.x = self.x + dx
        self.Q = (1 - self.b) * self.Q + self.b * outer
        self.e[sensor][used] = residual(sensor, z, self.x)[used]
        return float(y @ np.linalg.solve(S, y))


def unit_upper(R):
    lower = np.linalg.cholesky(R[::-1, ::-1])
    return (lower / lower.diagonal())[::-1, ::-1], (lower.diagonal() ** 2)[::-1]


def measurements(seed: int, rows: int):
    """Of the true model with four times the noise in range and bearing."""
    rng = np.random.default_rng(seed)
    x = np.array([-8.0, 0.0, 0.3])
    for _ in range(rows):
        x = np.array([x[0] - 0.03 * x[1], x[1] + 0.03 * x[0], 0.3])
        r = math.hypot(x[0], x[1])
        radar = np.array([r, math.atan2(x[1], x[0])]) + 4 * rng.normal(size=2) * [0.1, 0.02]
        radar[1] = wrap(float(radar[1]), 2 * math.pi)
        yield radar, np.array([x[0], x[1], 0.3 * r]) + rng.normal(size=3) * [0.3, 0.3, 0.5]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("a", "b"), [(A, 0.0), (0.0, B), (A, B)])
def test_recomputed(form, a, b):
    options = (f", adapt_R: {a}" if a else "") + (f", adapt_Q: {b}" if b else "")
    kf, dense = turning(f", covariance: {form}{options}"), Dense(a, b)
    rng = np.random.default_rng(9)
    for k, (radar, fix) in enumerate(measurements(1, 25)):
        assert kf.predict() == 0
        dense.predict()
        assert kf.update("radar", radar) == 0
        assert kf.nis == pytest.approx(dense.update("radar", radar, [0, 1]), rel=1e-9)
        used = [i for i in range(3) if k % 3 != 1 or rng.random() < 0.5]
        if used:
            assert kf.update("fix", fix, mask=sum(1 << i for i in used)) == 0
            assert kf.nis == pytest.approx(dense.update("fix", fix, used), rel=1e-9)
        np.testing.assert_allclose(kf.x, dense.x, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(kf.P, dense.P, rtol=1e-9, atol=1e-12)
        if a:
            for name in ("radar", "fix"):
                np.testing.assert_allclose(kf.R[name], dense.R[name], rtol=1e-9, atol=1e-12)
        if b:
            np.testing.assert_allclose(kf.Q, dense.Q, rtol=1e-9, atol=1e-12)
    if a:
        assert kf.R["radar"][1, 1] > 2 * R_RADAR[1, 1]


def state(kf) -> tuple[bytes, ...]:
    return (kf.x.tobytes(), kf.P.tobytes(), kf.Q.tobytes(), *(R.tobytes() for R in kf.R.values()), kf.t)


def learnt():
    kf = turning(f", adapt_R: {A}, adapt_Q: {B}")
    for radar, fix in measurements(2, 5):
        kf.predict()
        kf.update("radar", radar)
        kf.update("fix", fix)
    return kf


def test_only_there_where_asked_for():
    kf = turning(f", adapt_R: {A}")
    assert sorted(kf.R) == ["fix", "radar"]
    with pytest.raises(AttributeError, match="adapt_Q"):
        _ = kf.Q
    with pytest.raises(AttributeError, match="adapt_R"):
        _ = turning(f", adapt_Q: {B}").R
    kf.R["fix"][:] = 0.0  # a copy
    np.testing.assert_array_equal(kf.R["fix"], R_FIX)


def test_init_resets_and_set_leaves_alone():
    kf = learnt()
    R, Q = kf.R, kf.Q
    kf.set_state([1.0, 2.0, 0.1])
    kf.set_covariance(np.eye(3))
    np.testing.assert_array_equal(kf.Q, Q)
    np.testing.assert_array_equal(kf.R["fix"], R["fix"])
    # e is kept too: the next update adds a (H P H^T + e e^T) with the e of the last one
    kf.update("fix", [1.0, 2.0, 0.1])
    H = model("fix", np.array([1.0, 2.0, 0.1]))[1]
    e = kf.R["fix"] - (1 - A) * R["fix"] - A * H @ H.T
    assert np.linalg.matrix_rank(e, tol=1e-9) == 1
    assert np.trace(e) > 1e-3
    kf.init()
    np.testing.assert_array_equal(kf.R["fix"], R_FIX)
    np.testing.assert_array_equal(kf.Q, Q_OWN)
    kf.update("fix", [-8.0, 0.3, 0.2])
    H = model("fix", np.array([-8.0, 0.3, 0.2]))[1]
    expected = (1 - A) * R_FIX + A * H @ np.diag([0.5, 0.5, 0.1]) @ H.T
    np.testing.assert_allclose(kf.R["fix"], expected, rtol=1e-12, atol=1e-14)


def test_errors_and_empty_masks_leave_all_as_it_was():
    kf = learnt()
    before = state(kf)
    assert kf.update("radar", [math.nan, 0.0]) == Status.NOT_FINITE
    assert kf.update("fix", [1.0, math.inf, 0.0]) == Status.NOT_FINITE
    assert kf.update("fix", [math.nan] * 3, mask=0) == 0
    assert state(kf) == before
    twin = learnt()  # the residuals, too, which show in the next R
    for other in (kf, twin):
        assert other.update("fix", [-8.0, 0.0, 2.0]) == other.update("radar", [8.0, 3.1]) == 0
    assert state(kf) == state(twin)


def test_an_error_at_the_very_end():
    """The residual after the update is not finite: x, P, R, Q and the time stay."""
    text = one_state("  form: discrete\n  f: {x: x}\n  Q: {x: 0.1}", z="{h: sqrt(x), var: 0.01}")
    kf = build(text.replace("{type: ekf}", "{type: ekf, adapt_R: 0.1, adapt_Q: 0.1}"))
    kf.set_state([0.01])
    before = state(kf), kf.nis, kf.log_likelihood
    assert kf.update("s", [0.0]) == Status.NOT_FINITE  # x falls below 0
    assert (state(kf), kf.nis, kf.log_likelihood) == before
    assert kf.update("s", [0.2]) == 0


def test_a_gated_vector_teaches_nothing():
    text = TURNING.replace("noise: {scale", "gate: {probability: 0.999}\n    noise: {scale")
    kf = build(text.replace("type: ekf", f"type: ekf, adapt_R: {A}, adapt_Q: {B}"))
    kf.update("radar", [8.0, 3.1])
    before = state(kf)
    assert kf.update("radar", [80.0, 1.0]) == Status.GATED
    assert state(kf) == before
    kf.update("radar", [8.1, 3.1])
    twin = build(text.replace("type: ekf", f"type: ekf, adapt_R: {A}, adapt_Q: {B}"))
    twin.update("radar", [8.0, 3.1])
    twin.update("radar", [8.1, 3.1])
    assert state(kf) == state(twin)


def test_the_gate_judges_by_the_adapted_R():
    z = "{h: x, var: 1}\n    gate: {probability: 0.99}"
    text = one_state("  form: discrete\n  f: {x: x}", z=z).replace("{type: ekf}", "{type: kf, adapt_R: 0.5}")
    kf = build(text)
    assert kf.update("s", [1.0]) == 0
    r, P, x = kf.R["s"][0, 0], kf.P[0, 0], kf.x[0]
    assert r == pytest.approx(0.5 * 1.0 + 0.5 * 0.5)
    assert kf.update("s", [3.2]) == 0
    assert kf.nis == pytest.approx((3.2 - x) ** 2 / (P + 0.5 * (r + P)))


def test_initialize_teaches_nothing():
    text = TURNING.replace("dynamics:", "initialize: {from: fix, states: {x: px, y: py}}\ndynamics:")
    kf = build(text.replace("type: ekf", f"type: ekf, adapt_R: {A}, adapt_Q: {B}"))
    assert kf.update("fix", [-7.0, 1.0, 0.0]) == 0
    np.testing.assert_array_equal(kf.x[:2], [-7.0, 1.0])
    np.testing.assert_array_equal(kf.R["fix"], R_FIX)
    np.testing.assert_array_equal(kf.Q, Q_OWN)


def test_skipped_scalars_teach_Q_nothing():
    text = one_state("  form: discrete\n  f: {x: x}\n  Q: {x: 0.1}", z="{h: x, var: 0}\n      z2: {h: x, var: 0}")
    kf = build(text.replace("{type: ekf}", "{type: kf, adapt_Q: 0.25}"))
    assert kf.update("s", [3.0, 99.0]) == 0
    assert kf.Q[0, 0] == pytest.approx(0.75 * 0.1 + 0.25 * 4.0)
    assert kf.update("s", [5.0, 5.0]) == 0  # all is known
    assert kf.Q[0, 0] == pytest.approx(0.75 * (0.75 * 0.1 + 0.25 * 4.0))
    assert kf.predict() == 0
    assert kf.P[0, 0] == pytest.approx(kf.Q[0, 0])


@pytest.mark.parametrize("kind", ["ekf", "ekf2"])
def test_robust_gains_teach_Q(kind):
    """dx is that of the update as made: with psi, with the weight, with the inflation."""
    text = one_state("  form: discrete\n  f: {x: x}\n  Q: {x: 0.1}")
    options = "robust: chernodarov, adaptive: {chi2: 0.5}, adapt_Q: 0.25, adapt_R: 0.1"
    kf = build(text.replace("{type: ekf}", f"{{type: {kind}, {options}}}"))
    r = 0.9 * 1.0 + 0.1 * 0.5
    e = 4.0 / math.sqrt(r)
    nu, g = 4.0 / 3.0, 1.0 / 3.0
    c, s = 0.5, g * nu**2 / 0.5
    assert 3 < e < 6
    assert r + g * c < s
    assert kf.update("s", [5.0]) == Status.GLITCH_SMALL | Status.ANOMALY
    dx = (s - r) / g / s * nu
    assert kf.x[0] == pytest.approx(1.0 + dx)
    assert kf.Q[0, 0] == pytest.approx(0.75 * 0.1 + 0.25 * dx**2)
    assert kf.nis == pytest.approx(16.0 / (r + 0.5))
    # the next R knows the residual that was left
    P = kf.P[0, 0]
    kf.update("s", [kf.x[0]])
    assert kf.R["s"][0, 0] == pytest.approx(0.9 * r + 0.1 * (P + (4.0 - dx) ** 2))


def test_R_finds_the_truth():
    """Told a tenth of the standard deviation, the filter learns it: over many steps R comes near the truth."""
    text = one_state("  form: discrete\n  f: {x: x}\n  Q: {x: 0.01}", z="{h: x, var: 0.01}")
    kf = build(text.replace("{type: ekf}", "{type: kf, adapt_R: 0.01}"))
    rng = np.random.default_rng(11)
    x = 1.0
    for _ in range(1500):
        x += 0.1 * rng.normal()
        kf.predict()
        kf.update("s", [x + rng.normal()])
    assert 0.6 < kf.R["s"][0, 0] < 1.6
