"""The predict step: noise inputs, continuous form, covariances, time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import ATT, NOISE_INPUTS, VEHICLE4, one_state
from scipy.linalg import expm

from kfgen.reference import Status, reference
from kfgen.reference.model import wrap
from kfgen.spec import loads


def build(text: str):
    return reference(loads(text))


def differences(f, x, step=1e-6):
    """Central differences of a vector function: (m, len(x))."""
    columns = []
    for i in range(len(x)):
        d = np.zeros(len(x))
        d[i] = step
        columns.append((f(x + d) - f(x - d)) / (2 * step))
    return np.array(columns).T


def test_noise_inputs_through_the_integrator():
    """Two steps of the unicycle against a hand-written rk4 with numerical derivatives."""
    kf = build(NOISE_INPUTS)
    x, P, v, w, dt = kf.x, kf.P, 2.0, 1.5, 0.2

    def step(y, substeps=2):
        """(px, py, th, d, nv, nw) -> the state after dt."""
        state, nv, nw = y[:4], y[4], y[5]

        def f(s):
            return np.array(
                [v * (1 + nv) * np.cos(s[2]), v * (1 + nv) * np.sin(s[2]), w + s[3] + nw, -s[3] / 100]
            )

        h = dt / substeps
        for _ in range(substeps):
            k1 = f(state)
            k2 = f(state + h / 2 * k1)
            k3 = f(state + h / 2 * k2)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(state + h * k3))
        return state

    for _ in range(2):
        J = differences(step, np.array([*x, 0.0, 0.0]))
        F, G = J[:, :4], J[:, 4:]
        Q = np.diag([1e-4 * dt, 1e-4 * dt, 0.0, 1e-4 * dt])  # d: (0.01)^2 unit^2/Hz over dt
        P = F @ P @ F.T + G @ np.diag([0.1**2, 0.04 * dt]) @ G.T + Q
        x = step(np.array([*x, 0.0, 0.0]))
        x[2] = wrap(float(x[2]), 2 * math.pi)
        assert kf.predict([v, w], dt) == 0
        np.testing.assert_allclose(kf.x, x, rtol=1e-12)
        np.testing.assert_allclose(kf.P, P, rtol=1e-8, atol=1e-11)
    assert kf.x[2] < 0  # it has passed pi

    # the compass: R = 0.05^2 + M 0.1^2 M^T with M = cos(th); residual wrapped
    H, r = np.array([[0.0, 0, 1, 0]]), 0.0025 + (np.cos(x[2]) * 0.1) ** 2
    z = wrap(float(x[2] + 0.1), 2 * math.pi)
    S = (H @ kf.P @ H.T)[0, 0] + r
    expected = kf.x + (kf.P @ H.T / S)[:, 0] * 0.1
    assert kf.update("compass", [z + 4 * math.pi]) == 0
    np.testing.assert_allclose(kf.x, expected, rtol=1e-10)
    assert kf.nis == pytest.approx(0.01 / S, rel=1e-9)


def test_attitude_noise_enters_through_the_quaternion():
    kf = build(ATT)
    q, dt, g = kf.x[:4], 0.01, 0.01
    kf.set_covariance(np.zeros((7, 7)))
    q = np.array([0.6, -0.4, 0.5, 0.3])
    kf.set_state([*q, 0.01, 0.02, -0.03])
    assert kf.predict([0.1, -0.2, 0.3]) == 0
    G = (
        dt
        / 2
        * np.array([[-q[1], -q[2], -q[3]], [q[0], -q[3], q[2]], [q[3], q[0], -q[1]], [-q[2], q[1], q[0]]])
    )
    np.testing.assert_allclose(kf.P[:4, :4], g**2 * G @ G.T, rtol=1e-12, atol=1e-20)
    np.testing.assert_allclose(kf.P[4:, 4:], 1e-10 * np.eye(3))
    kf.parameters["sigma_gyro"] = 0.0
    kf.set_covariance(np.zeros((7, 7)))
    assert kf.predict([0.1, -0.2, 0.3]) == 0
    assert not kf.P[:4, :4].any()
    kf.init()
    assert kf.parameters["sigma_gyro"] == 0.01


def test_jacobian_at_the_prior_not_at_the_prediction():
    kf = build(VEHICLE4)
    x, P, dt = kf.x, kf.P, 1 / 3
    F = np.eye(4)
    F[0, 2:] = dt * math.cos(x[3]), -dt * x[2] * math.sin(x[3])
    F[1, 2:] = dt * math.sin(x[3]), dt * x[2] * math.cos(x[3])
    kf.predict()
    np.testing.assert_allclose(
        kf.P, F @ P @ F.T + np.diag([0, 0, 25 * dt, 0.25 * dt]), rtol=1e-14, atol=1e-14
    )


def test_full_state_dependent_Q_at_the_prior():
    text = one_state(
        "  form: discrete\n  f: {x: x + u}\n  Q: [[x**2, 0.1*x], [0.1*x, 4*dt]]",
        extra="inputs: {u: {}}",
        states="  y: {init: 0, var: 0.5}",
    )
    kf = build(text)
    assert kf.predict([2.0]) == 0
    np.testing.assert_allclose(kf.P, [[1.5, 0.1], [0.1, 0.9]], rtol=1e-15)
    kf.set_state([3.0, 0.0])
    kf.parameters.update()
    assert kf.predict([0.0]) == 0
    np.testing.assert_allclose(kf.P, [[10.5, 0.4], [0.4, 1.3]], rtol=1e-14)


def test_exact_integrator_and_density():
    """A damped oscillator with a force held over the step and a white one: expm and its noise integral."""
    text = one_state(
        "  form: continuous\n  f: {x: v, v: -4*x - 0.5*v + u + 1 + n + 2*w}\n"
        "  integrator: exact\n  Q: {x: 0.01}",
        extra="inputs: {u: {}}\nnoise: {n: {std: 0.3}, w: {density: 0.2}}",
        states="  v: {init: 0.5, var: 0.2}",
        dt="{nominal: 0.1}",
    )
    kf = build(text)
    A, B, dt = np.array([[0.0, 1], [-4, -0.5]]), np.array([0.0, 1.0]), 0.3
    F = expm(A * dt)
    G = np.linalg.solve(A, (F - np.eye(2)) @ B)
    s = np.linspace(0.0, dt, 20001)
    path = np.array([expm(A * v) @ [0.0, 2.0] for v in s[::100]])
    integrand = 0.2 * path[:, :, None] * path[:, None, :]
    h = s[100] - s[0]
    weights = np.ones(len(integrand))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    Qd = h / 3 * np.einsum("k,kij->ij", weights, integrand)
    x, P = kf.x, kf.P
    assert kf.predict([2.0], dt) == 0
    np.testing.assert_allclose(kf.x, F @ x + G * 3.0, rtol=1e-13)
    expected = F @ P @ F.T + 0.09 * np.outer(G, G) + Qd + np.diag([0.01, 0.0])
    np.testing.assert_allclose(kf.P, expected, rtol=1e-10)


@pytest.mark.parametrize("substeps", [1, 4])
def test_density_without_exact_is_one_rectangle(substeps):
    text = one_state(
        f"  form: continuous\n  f: {{x: -x**3 + x*w}}\n  integrator: midpoint\n  substeps: {substeps}",
        extra="noise: {w: {root_density: 0.5}}",
    )
    kf = build(text)
    assert kf.predict() == 0
    x, F, h = 1.0, 1.0, 0.1 / substeps
    for _ in range(substeps):
        m, dm = x - h / 2 * x**3, 1 - h / 2 * 3 * x**2
        F *= 1 - h * 3 * m**2 * dm
        x = x - h * m**3
    assert kf.x[0] == pytest.approx(x, rel=1e-14)
    assert kf.P[0, 0] == pytest.approx(F**2 * 0.5 + 0.25 * 0.1, rel=1e-13)


def test_time():
    """f sees the step's start, h the time after predict."""
    dynamics = "  form: discrete\n  f: {x: t}"
    kf = build(one_state(dynamics, z="{h: x - t, var: 1}"))
    for k in range(30):
        assert kf.predict() == 0
        assert kf.x[0] == float(k * 0.1) or kf.x[0] == pytest.approx(k * 0.1, rel=1e-15)
    assert kf.t == 3.0
    kf.update("s", [0.0])  # y = 0 - (2.9 - 3.0)
    assert kf.nis == pytest.approx(0.01, rel=1e-9)
    kf = build(one_state(dynamics, dt="{nominal: 0.1, min: 0.01, max: 5}"))
    for _ in range(10000):
        kf.predict(dt=0.1)
    assert kf.t == pytest.approx(1000.0, abs=2e-13)
    kf.init()
    assert kf.t == 0.0


def test_run_time_step():
    kf = build(one_state("  form: discrete\n  f: {x: x + dt}", dt="{nominal: 0.1, min: 0.01, max: 5}"))
    assert kf.predict(dt=0.5) == 0
    assert kf.predict(dt=9.0) == Status.DT_CLAMPED
    assert kf.predict(dt=-3.0) == Status.DT_CLAMPED
    assert kf.x[0] == pytest.approx(1.0 + 0.5 + 5.0 + 0.01)
    assert kf.predict(dt=math.nan) == Status.NOT_FINITE
    assert kf.predict(dt=math.inf) == Status.NOT_FINITE
    assert kf.t == pytest.approx(5.51)
    with pytest.raises(TypeError):
        kf.predict()
    kf = build(one_state("  form: discrete\n  f: {x: x + dt}", dt="{nominal: 0.1, max: 5}"))
    assert kf.predict(dt=0.0) == Status.NOT_POSITIVE
    assert kf.predict(dt=-1.0) == Status.NOT_POSITIVE
    assert kf.x[0] == 1.0
    assert kf.predict(dt=6.0) == Status.DT_CLAMPED
