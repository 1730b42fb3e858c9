"""Noise inputs of sigma-point filters: which are carried as dimensions of the points, and what that is worth."""

from __future__ import annotations

import numpy as np
import pytest
from problems import one_state

from kfgen.reference import Status, reference
from kfgen.reference.carried import carried_by_process, carried_by_sensor
from kfgen.reference.model import Model
from kfgen.spec import loads

NOISES = "noise: {w: {std: 0.1}, v: {std: 0.2}}\nparameters: {p: 2}\ninputs: {u: {}}\nlet: {d: x*w, c: p + u}\n"


def process(f: str, form: str = "discrete", options: str = "", extra: str = "", dt: str = "0.1") -> tuple[str, ...]:
    dynamics = f"  form: {form}\n  f: {{x: '{f}'}}{extra}"
    text = one_state(dynamics, NOISES, dt=dt, states="  y: {init: 0, var: 1}")
    return carried_by_process(Model(loads(text.replace("type: ekf", f"type: ukf{options}"))))


@pytest.mark.parametrize(
    ("f", "carried"),
    [
        ("x + w", ""),
        ("sin(x) + 3*w - p*v*u", ""),
        ("x + c*w/(1 + u**2)", ""),
        ("x*w", "w"),
        ("x*w*v", "wv"),
        ("x + w*v", "wv"),
        ("d + v", "w"),
        ("x + w**2", "w"),
        ("x + w**1", ""),
        ("x + 2**w + v/p", "w"),
        ("x + v/y", "v"),
        ("x/w", "w"),
        ("abs(w) + x", "w"),
        ("sin(w + v)", "wv"),
        ("sin(x + w) + v", "w"),
        ("where(x > 0, w, 2*w)", "w"),
        ("where(u > 0, w, 2*w) + x", ""),
        ("where(w > 0, x, 2*x)", ""),
        ("floor(w) + sign(v) + x", ""),
        ("min(w, 3)", "w"),
        ("max(x, 3) + w", ""),
        ("table(x, [0, 1], [0, 2]) + w", ""),
        ("table(w, [0, 1], [0, 2]) + v", "w"),
        ("0*x*w + v", ""),
        ("w*cos(0)*2**3 + x", ""),
        ("x*(1 - 1)*w + atan2(v, 1)", "v"),
        ("x + w*where(y > 0, 1, 2)", "w"),
    ],
)
def test_structure(f, carried):
    assert process(f) == tuple(carried)


@pytest.mark.parametrize(
    ("f", "integrator", "carried"),
    [
        ("w - x", "rk4", ""),
        ("w*x", "rk4", "w"),
        ("w - x**3", "euler", ""),
        # the step, not the rate, counts: later stages have w inside the cube
        ("w - x**3", "rk4", "w"),
        ("w - x**3", "midpoint", "w"),
        ("w - u*x + v", "exact", ""),
        ("w**2 - x + v", "exact", "w"),
        ("sin(y) + w", "rk4", ""),
        ("sin(y)*v + w", "rk4", "v"),
    ],
)
def test_structure_of_an_integrated_step(f, integrator, carried):
    assert process(f, "continuous", extra=f"\n  integrator: {integrator}") == tuple(carried)


def test_substeps():
    """With euler, w reaches the cube in the second substep."""
    assert process("w - x**3", "continuous", extra="\n  integrator: euler\n  substeps: 2") == ("w",)


def test_augment_densities_and_correlations():
    assert process("x + w", options=", augment: true") == ("w", "v")
    assert process("x*w + v", options=", augment: true") == ("w", "v")
    text = one_state(
        "  form: continuous\n  f: {x: a*x + b + c + d*x}\n  integrator: euler",
        "noise: {a: {}, b: {}, c: {}}\nnoise_covariance: [[1, 0.5, 0], [0.5, 1, 0.1], [0, 0.1, 1]]\nparameters: {d: 1}",
    ).replace("type: ekf", "type: ukf")
    assert carried_by_process(Model(loads(text))) == ("a", "b", "c")
    apart = text.replace("0.1]", "0]").replace("[0, 0.1", "[0, 0.0")
    assert carried_by_process(Model(loads(apart))) == ("a", "b")
    white = text.replace("parameters: {d: 1}", "").replace(
        "noise: {a: {}, b: {}, c: {}}\nnoise_covariance: [[1, 0.5, 0], [0.5, 1, 0.1], [0, 0.1, 1]]",
        "noise: {a: {density: 1}, b: {var: 1}, c: {var: 1}, d: {density: 1}}",
    )
    assert carried_by_process(Model(loads(white))) == ()
    assert carried_by_process(Model(loads(white.replace("type: ukf", "type: ukf, augment: true")))) == ("b", "c")


@pytest.mark.parametrize(
    ("h", "carried"), [("x + e1", ""), ("x*e1 + e2", "e1"), ("x + exp(e1)*e2", "e1 e2"), ("sin(x) + e1*p*u", "")]
)
def test_sensors(h, carried):
    z = f"{{h: '{h}', std: 1}}\n    noise: {{e1: {{std: 0.1}}, e2: {{std: 0.1}}}}"
    text = one_state("  form: discrete\n  f: {x: x}", "parameters: {p: 2}\ninputs: {u: {}}", z)
    model = Model(loads(text.replace("type: ekf", "type: ukf")))
    assert carried_by_sensor(model, model.spec.measurements[0]) == tuple(carried.split())
    every = Model(loads(text.replace("type: ekf", "type: ukf, augment: true")))
    assert carried_by_sensor(every, every.spec.measurements[0]) == ("e1", "e2")


# a vehicle whose speed is measured by a wheel with a relative error of 5 %
WHEEL = """
kfgen: 1
name: wheel
scalar: double
dt: 1
states:
  px: {init: 0, std: 0.1}
  th: {init: 0.5, std: 0.05}
inputs: {v: {}}
noise:
  slip: {std: 0.05}
  turn: {std: 0.02}
dynamics:
  form: discrete
  f: {px: px + v*(1 + slip)*cos(th + turn), th: th + turn + 0.1*slip}
measurements:
  s:
    z:
      d: {h: px*(1 + e1)}
    noise: {e1: {std: 0.05}}
filter: {type: ukf}
"""


def sample(rng, x, P, n=1_000_000):
    root = np.linalg.cholesky(P)
    return x[:, None] + root @ rng.normal(size=(2, n))


@pytest.mark.parametrize("form", ["full", "ud", "sqrt"])
@pytest.mark.parametrize("points", ["{}", "{kind: merwe, alpha: 0.3}", "{kind: julier, kappa: 1}"])
def test_multiplicative_noise_against_samples(form, points):
    """Mean and covariance of a prediction, and of a predicted reading, within 1 % of a million samples."""
    kf = reference(loads(WHEEL.replace("type: ukf", f"type: ukf, covariance: {form}, sigma_points: {points}")))
    rng = np.random.default_rng(1)
    px, th = sample(rng, kf.x, kf.P)
    slip, turn = 0.05 * rng.normal(size=px.size), 0.02 * rng.normal(size=px.size)
    after = np.array([px + 10.0 * (1.0 + slip) * np.cos(th + turn), th + turn + 0.1 * slip])
    assert kf.predict([10.0]) == 0
    np.testing.assert_allclose(kf.x, after.mean(axis=1), rtol=0.01)
    scale = np.sqrt(np.outer(kf.P.diagonal(), kf.P.diagonal()))
    np.testing.assert_allclose(np.cov(after) / scale, kf.P / scale, atol=0.01)

    px = sample(rng, kf.x, kf.P)[0]
    d = px * (1.0 + 0.05 * rng.normal(size=px.size))
    P = kf.P
    assert kf.update("s", [d.mean() + d.std()]) == 0
    assert kf.nis == pytest.approx(1.0, rel=0.02)
    assert P[0, 0] - kf.P[0, 0] == pytest.approx(P[0, 0] ** 2 / d.var(), rel=0.01)


def test_sequential_carries_what_regression_finds():
    """One by one, what z - H x - M e varies by is left out; for a product, H and M are those of an ekf."""
    text = WHEEL.replace("type: ukf", "type: ukf, sequential: true").replace("init: 0, std: 0.1", "init: 7, std: 0.1")
    kf, ekf = reference(loads(text)), reference(loads(text.replace("type: ukf, sequential: true", "type: ekf")))
    for f in (kf, ekf):
        assert f.update("s", [7.2]) == 0
    np.testing.assert_allclose(kf.P, ekf.P, rtol=1e-10, atol=1e-15)
    np.testing.assert_allclose(kf.x, ekf.x, rtol=1e-10)


def test_custom_points_carry_no_noise():
    """They have columns for the states only: noises stay G Qw G^T at the prior."""
    root = repr(float(np.sqrt(2.0)))
    rows = f"[[0, 0], [{root}, 0], [0, {root}], [-{root}, 0], [0, -{root}]]"
    custom = f"{{kind: custom, points: {rows}, wm: [0, 0.25, 0.25, 0.25, 0.25], wc: [0, 0.25, 0.25, 0.25, 0.25]}}"
    text = WHEEL.replace("type: ukf", f"type: ukf, sigma_points: {custom}")
    kf = reference(loads(text))
    bare = reference(loads(WHEEL.replace("type: ukf", "type: ukf, sigma_points: {kind: julier}").replace(
        "slip: {std: 0.05}", "slip: {std: 0}").replace("turn: {std: 0.02}", "turn: {std: 0}")))  # fmt: skip
    assert kf.predict([10.0]) == bare.predict([10.0]) == 0
    G = np.array([[10.0 * np.cos(0.5), -10.0 * np.sin(0.5)], [0.1, 1.0]])
    np.testing.assert_allclose(kf.P, bare.P + G @ np.diag([0.05**2, 0.02**2]) @ G.T, rtol=0.02)
    assert kf.update("s", [8.0]) == 0


def test_indefinite_run_time_noise():
    """What is not finite comes before what is not positive, whatever carries it."""
    extra = "noise: {w: {var: a}, v: {var: b}}\nparameters: {a: 1, b: 1, q: 1}"
    text = one_state("  form: discrete\n  f: {x: x*(1 + w)/q + v}", extra)
    kf = reference(loads(text.replace("type: ekf", "type: ukf")))
    before = kf.x.tobytes() + kf.P.tobytes()
    for name in ("a", "b"):
        kf.parameters[name] = -1.0
        assert kf.predict() == Status.NOT_POSITIVE
        kf.parameters["q"] = 0.0
        assert kf.predict() == Status.NOT_FINITE
        kf.parameters["q"] = 1.0
        kf.parameters[name] = np.nan
        assert kf.predict() == Status.NOT_FINITE
        kf.parameters[name] = 0.0
        assert kf.predict() == 0
        kf.init()
    assert kf.x.tobytes() + kf.P.tobytes() == before


def test_singular_correlated_noise():
    """Two noises that are one: their covariance has rank 1."""
    text = one_state(
        "  form: discrete\n  f: {x: x*(1 + w) - x*v}",
        "noise: {w: {}, v: {}}\nnoise_covariance: [[1, 1], [1, 1]]",
    )
    for form in ("full", "ud", "sqrt"):
        kf = reference(loads(text.replace("type: ekf", f"type: ukf, covariance: {form}")))
        for _ in range(20):
            assert kf.predict() == 0
        np.testing.assert_allclose(kf.P, [[0.5]], rtol=1e-12)
        assert kf.x[0] == pytest.approx(1.0, rel=1e-13)


def test_exact_integrator_with_a_carried_noise():
    """dx/dt = -x + w^2: a step of w^2 (1 - exp(-dt)) at each point."""
    text = one_state("  form: continuous\n  f: {x: w**2 - x}\n  integrator: exact", "noise: {w: {var: 0.3}}")
    kf = reference(loads(text.replace("type: ekf", "type: ukf, sigma_points: {kind: julier, kappa: 1}")))
    assert kf.predict() == 0
    decay = np.exp(-0.1)
    assert kf.x[0] == pytest.approx(decay + 0.3 * (1.0 - decay), rel=1e-13)
    # julier in two dimensions with kappa 1: E w^4 = gamma var^2 = 3 var^2, as for a Gaussian
    assert kf.P[0, 0] == pytest.approx(0.5 * decay**2 + 2.0 * 0.09 * (1.0 - decay) ** 2, rel=1e-12)
