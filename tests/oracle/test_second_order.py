"""The second-order filter against moments of Gaussian variables in closed form."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from problems import NOISE_INPUTS, RADAR, SIX_SENSORS, one_state

from kfgen.reference import Status, reference
from kfgen.reference.model import wrap
from kfgen.spec import loads

FORMS = ["ud", "ud, update: joseph", "full", "full, update: standard", "sqrt"]


def build(text: str):
    return reference(loads(text))


def one(f: str = "x", z: str = "{h: x, var: 1}", options: str = "", form: str = "discrete", **more: str):
    text = one_state(f"  form: {form}\n  f: {{x: {f}}}\n  Q: {{x: 0.1}}", z=z, **more)
    return build(text.replace("{type: ekf}", f"{{type: ekf2{options}}}"))


@pytest.mark.parametrize("form", FORMS)
def test_a_square_measured(form):
    """z = x^2 + v: E z = m^2 + P, var z = 4 m^2 P + 2 P^2 + r, cov(x, z) = 2 m P: the best linear estimate."""
    kf = one(z="{h: x**2, var: 0.2}", options=f", covariance: {form}")
    m, P, r, z = 1.0, 0.5, 0.2, 2.5
    S, y = 4 * m**2 * P + 2 * P**2 + r, z - m**2 - P
    assert kf.update("s", [z]) == 0
    assert kf.x[0] == pytest.approx(m + 2 * m * P / S * y, rel=1e-14)
    assert kf.P[0, 0] == pytest.approx(P - (2 * m * P) ** 2 / S, rel=1e-13)
    assert kf.nis == pytest.approx(y**2 / S, rel=1e-13)
    assert kf.log_likelihood == pytest.approx(-0.5 * (math.log(2 * math.pi * S) + y**2 / S), rel=1e-13)


def test_a_square_predicted():
    kf = one(f="x**2")
    assert kf.predict() == 0
    assert kf.x[0] == pytest.approx(1.0 + 0.5, rel=1e-15)
    assert kf.P[0, 0] == pytest.approx(4 * 0.5 + 2 * 0.25 + 0.1, rel=1e-15)


@pytest.mark.parametrize(
    ("f", "mean", "variance"),
    [
        ("x*(1 + w)", 2.0, 0.5 + 4 * 0.3 + 0.5 * 0.3),  # m = 2, P = 0.5, var w = 0.3
        ("x + w**2", 2.0 + 0.3, 0.5 + 2 * 0.09),
        ("x + w*v", 2.0 + 0.1, 0.5 + 0.3 * 0.4 + 0.01),  # var v = 0.4, cov(w, v) = 0.1
        ("x*w + w", 0.0, 0.3 * 9 + 0.5 * 0.3),
    ],
)
def test_products_with_noise(f, mean, variance):
    """Bilinear and quadratic in (x, w): their second-order moments are exact."""
    kf = one(f=f, extra="noise: {w: {}, v: {}}\nnoise_covariance: [[0.3, 0.1], [0.1, 0.4]]")
    kf.set_state([2.0])
    assert kf.predict() == 0
    assert kf.x[0] == pytest.approx(mean, rel=1e-14, abs=1e-15)
    assert kf.P[0, 0] == pytest.approx(variance + 0.1, rel=1e-14)


def test_products_with_measurement_noise():
    """z = x (1 + a) + a b: mean m + cov(a, b), and the joint second-order variance."""
    more = "\n    noise: {a: {}, b: {}}\n    noise_covariance: [[0.3, 0.1], [0.1, 0.4]]"
    kf = one(z="{h: x*(1 + a) + a*b, var: 0.2}" + more)
    kf.set_state([2.0])
    S = 0.5 + 4 * 0.3 + 0.2 + (0.5 * 0.3 + 0.3 * 0.4 + 0.01)
    y = 3.0 - 2.0 - 0.1
    assert kf.update("s", [3.0]) == 0
    assert kf.x[0] == pytest.approx(2.0 + 0.5 / S * y, rel=1e-14)
    assert kf.nis == pytest.approx(y**2 / S, rel=1e-13)


def bends(f, point, step="1e-12"):
    """Second derivatives (m, k, k) of f, a function of mpmath numbers, by central differences in 50 digits."""
    with mpmath.workdps(50):
        h, k = mpmath.mpf(step), len(point)

        def at(*moves):
            moved = [mpmath.mpf(float(v)) for v in point]
            for i, sign in moves:
                moved[i] += sign * h
            return f(moved)

        out = np.zeros((len(f([mpmath.mpf(float(v)) for v in point])), k, k))
        for i in range(k):
            for j in range(k):
                corners = [at((i, a), (j, b)) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
                for m, (pp, pm, mp, mm) in enumerate(zip(*corners, strict=True)):
                    out[m, i, j] = float((pp - pm - mp + mm) / (4 * h * h))
    return out


def test_radar():
    """Range and bearing about a point: Hessians by differences, the bearing's residual wrapped once."""
    text = RADAR.replace("    gate: {probability: 0.9999}\n", "").replace("py: {init: 20", "py: {init: 1")
    kf = build(text.replace("type: ekf", "type: ekf2"))
    x, P = kf.x, kf.P
    point = np.array([-100.0, 1.0])
    second = bends(lambda v: [mpmath.hypot(v[0], v[1]), mpmath.atan2(v[1], v[0])], point) @ P[:2, :2]
    shift = np.array([0.5 * np.trace(b) for b in second])
    spread = np.array([[0.5 * np.trace(a @ b) for b in second] for a in second])
    r = math.hypot(*point)
    H = np.array([[point[0] / r, point[1] / r, 0, 0], [-point[1] / r**2, point[0] / r**2, 0, 0]])
    S = H @ P @ H.T + np.diag([4.0, 4e-4]) + spread
    z = np.array([103.0, -3.1])
    y = z - np.array([r, math.atan2(point[1], point[0])]) - shift
    y[1] = wrap(float(y[1]), 2 * math.pi)
    assert kf.update("radar", z) == 0
    np.testing.assert_allclose(kf.x, x + P @ H.T @ np.linalg.solve(S, y), rtol=1e-11)
    np.testing.assert_allclose(kf.P, P - P @ H.T @ np.linalg.solve(S, H @ P), rtol=1e-9, atol=1e-11)
    assert kf.nis == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-10)


def test_noise_inputs_through_the_integrator():
    """The unicycle: what is added to the ekf's prediction, from a hand-written rk4; densities in first order."""
    kf = build(NOISE_INPUTS.replace("type: ekf", "type: ekf2"))
    ekf = build(NOISE_INPUTS)
    v, w, dt = 2.0, 1.5, mpmath.mpf("0.2")

    def step(s):
        state, nv, nw = s[:4], s[4], s[5]

        def f(y):
            return [v * (1 + nv) * mpmath.cos(y[2]), v * (1 + nv) * mpmath.sin(y[2]), w + y[3] + nw, -y[3] / 100]

        h = dt / 2
        for _ in range(2):
            k1 = f(state)
            k2 = f([a + h / 2 * b for a, b in zip(state, k1, strict=True)])
            k3 = f([a + h / 2 * b for a, b in zip(state, k2, strict=True)])
            k4 = f([a + h * b for a, b in zip(state, k3, strict=True)])
            state = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(state, k1, k2, k3, k4, strict=True)]
        return state

    P = kf.P
    for filter_ in (kf, ekf):
        assert filter_.predict([v, w], 0.2) == 0
    B = np.zeros((6, 6))
    B[:4, :4], B[4, 4], B[5, 5] = P, 0.1**2, 0.04 * 0.2
    second = bends(step, [0.0, 0.0, 3.0, 0.0, 0.0, 0.0]) @ B
    shift = np.array([0.5 * np.trace(b) for b in second])
    spread = np.array([[0.5 * np.trace(a @ b) for b in second] for a in second])
    np.testing.assert_allclose(kf.x[:2], ekf.x[:2] + shift[:2], rtol=1e-11)
    np.testing.assert_allclose(kf.x[2:], ekf.x[2:], rtol=1e-14)
    np.testing.assert_allclose(kf.P, ekf.P + spread, rtol=1e-10, atol=1e-14)
    assert np.max(np.abs(shift)) > 1e-3


def test_exact_integrator_with_a_squared_noise():
    """dx/dt = -x + w^2, w held: x' = F x + (1 - F) w^2."""
    kf = one("-x + w**2", form="continuous", extra="noise: {w: {var: 0.3}}", dt="0.5")
    exact = build(
        one_state(
            "  form: continuous\n  f: {x: -x + w**2}\n  integrator: exact\n  Q: {x: 0.1}",
            extra="noise: {w: {var: 0.3}}",
            dt="0.5",
        ).replace("{type: ekf}", "{type: ekf2}")
    )
    F = math.exp(-0.5)
    assert exact.predict() == kf.predict() == 0
    assert exact.x[0] == pytest.approx(F + (1 - F) * 0.3, rel=1e-14)
    assert exact.P[0, 0] == pytest.approx(F**2 * 0.5 + (1 - F) ** 2 * 2 * 0.09 + 0.1, rel=1e-14)
    assert kf.x[0] == pytest.approx(exact.x[0], rel=1e-3)


def test_an_own_residual_is_given_the_second_order_prediction():
    kf = one(z='{h: x**2, var: 0.2, residual: "2*(z - h)"}')
    assert kf.update("s", [2.5]) == 0
    S = 4 * 0.5 + 2 * 0.25 + 0.2
    assert kf.x[0] == pytest.approx(1.0 + 2 * 0.5 / S * 2 * (2.5 - 1.5), rel=1e-14)


def test_linear_models_are_those_of_the_kf():
    kf, second = build(SIX_SENSORS), build(SIX_SENSORS.replace("type: kf", "type: ekf2"))
    for k in range(4):
        assert kf.predict() == second.predict() == 0
        assert kf.update("level", np.arange(6.0) + k) == second.update("level", np.arange(6.0) + k) == 0
        np.testing.assert_array_equal(kf.x, second.x)
        np.testing.assert_array_equal(kf.P, second.P)


def test_robust_and_adaptive_act_on_its_variances():
    """sigma^2 is r with the curvature's part, s that with h P h^T."""
    kf = one(z="{h: x**2, var: 0.2}", options=", robust: huber, adaptive: {chi2: 0.1}")
    r, c, y = 0.2 + 2 * 0.25, 4 * 0.5, 1.0
    assert y / math.sqrt(r) < 1.345
    s = max(r + c, y**2 / 0.1)
    assert kf.update("s", [1.5 + y]) == Status.ANOMALY
    c *= (s - r) / c
    assert kf.x[0] == pytest.approx(1.0 + c / 2 / s * y, rel=1e-13)
    assert kf.P[0, 0] == pytest.approx(c / 4 - (c / 2) ** 2 / s, rel=1e-12)
    assert kf.nis == pytest.approx(y**2 / (r + 2.0), rel=1e-13)


def test_adapted_R_is_without_the_curvature():
    kf = one(z="{h: x**2, var: 0.2}", options=", adapt_R: 0.1")
    assert kf.update("s", [2.0]) == 0
    R = 0.9 * 0.2 + 0.1 * 2.0
    assert kf.R["s"][0, 0] == pytest.approx(R, rel=1e-14)
    assert kf.nis == pytest.approx(0.25 / (R + 2 * 0.25 + 2.0), rel=1e-13)
    x, P = kf.x[0], kf.P[0, 0]
    assert kf.update("s", [2.0]) == 0
    assert kf.R["s"][0, 0] == pytest.approx(0.9 * R + 0.1 * (4 * x * x * P + (2.0 - x * x) ** 2), rel=1e-13)


@pytest.mark.parametrize(("f", "h"), [("abs(x)**1.5", "x"), ("x", "abs(x)**1.5")])
def test_an_infinite_bend_leaves_all_as_it_was(f, h):
    kf = one(f=f, z=f"{{h: {h}, var: 1}}")
    kf.set_state([0.0])
    before = kf.x.tobytes(), kf.P.tobytes(), kf.t, kf.nis
    assert (kf.predict() if h == "x" else kf.update("s", [1.0])) == Status.NOT_FINITE
    assert (kf.x.tobytes(), kf.P.tobytes(), kf.t, kf.nis) == before


def test_semidefinite():
    """No prior variance: no curvature either; exact sensors; the same sensor twice."""
    kf = one(f="x**2", z="{h: x**2, var: 0}\n      z2: {h: x**2, var: 0}")
    kf.set_covariance([[0.0]])
    assert kf.update("s", [3.0, 3.0]) == 0
    assert (kf.x[0], kf.P[0, 0], kf.nis) == (1.0, 0.0, 0.0)
    kf.set_covariance([[0.5]])
    assert kf.update("s", [2.0, 2.0]) == 0
    # the curvature's variance 2 P^2 is common to both: the second adds nothing
    assert kf.x[0] == pytest.approx(1.0 + 1.0 / 2.5 * 0.5, rel=1e-13)
    assert kf.P[0, 0] == pytest.approx(0.5 - 1.0 / 2.5, rel=1e-12)
