"""On a linear model a sigma-point filter is the Kalman filter, whatever the points and the form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import NOISE_INPUTS, SIX_SENSORS
from test_filterpy import linear_spec, random_covariance
from test_semidefinite import two_states

from kfgen.reference import Status, reference
from kfgen.spec import loads

KINDS = {
    "merwe": "{kind: merwe, alpha: 0.5, beta: 2, kappa: 1}",
    "merwe 1 2 0": "{}",
    "julier": "{kind: julier, kappa: 1}",
    "julier negative": "{kind: julier, kappa: -0.5}",
    "wiki": "{kind: wiki, alpha: 0.7, beta: 2}",
    "wiki kappa": "{kind: wiki, alpha: 1, beta: 0, kappa: 2.5}",
    "trivial": "{kind: trivial}",
    "cubature": "{kind: cubature}",
}
FORMS = ("full", "ud", "sqrt", "ud, sequential: true")


def ukf(text: str, form: str, points: str) -> str:
    old = "type: kf" if "type: kf" in text else "type: ekf"
    return text.replace(old, f"type: ukf, covariance: {form}, sigma_points: {points}")


def random_problem(seed: int, n: int, m: int) -> str:
    rng = np.random.default_rng(seed)
    F = np.eye(n) + 0.2 * rng.normal(size=(n, n))
    F /= max(1.0, np.max(np.abs(np.linalg.eigvals(F))))
    B, H = rng.normal(size=(n, 1)), rng.normal(size=(m, n))
    Q, R = random_covariance(rng, n, rank=1), random_covariance(rng, m) + 0.1 * np.eye(m)
    P0 = random_covariance(rng, n)
    Q, R, P0 = (np.round((A + A.T) / 2, 12) for A in (Q, R, P0))
    return linear_spec(F, B, Q + 1e-9 * np.eye(n), H, R, P0 + 1e-9 * np.eye(n), rng.normal(size=n))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("redraw", ["true", "false"])
def test_equals_the_kalman_filter(kind, form, redraw):
    text = random_problem(len(kind), n=3, m=2)
    points = KINDS[kind].replace("}", f", redraw: {redraw}}}").replace("{, ", "{")
    kf, uf = reference(loads(text)), reference(loads(ukf(text, form, points)))
    rng = np.random.default_rng(5)
    for _ in range(20):
        u, z = rng.normal(size=1), rng.normal(size=2)
        assert kf.predict(u) == uf.predict(u) == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-10)
        if redraw == "false":
            # without Q in the points the update is another one: it is tested elsewhere
            assert uf.redraw() == 0
        assert kf.update("s", z) == uf.update("s", z) == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-10)
        assert uf.nis == pytest.approx(kf.nis, rel=1e-10, abs=1e-12)
        assert uf.log_likelihood == pytest.approx(kf.log_likelihood, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_custom_points(form):
    """Three points of a triangle: no centre, and exact for two states."""
    a, b = repr(math.sqrt(0.5)), repr(math.sqrt(1.5))
    rows = f"[[{math.sqrt(2)!r}, 0], [-{a}, {b}], [-{a}, -{b}]]"
    points = f"{{kind: custom, points: {rows}, wm: [1/3, 1/3, 1/3], wc: [1/3, 1/3, 1/3]}}"
    text = random_problem(11, n=2, m=2)
    kf, uf = reference(loads(text)), reference(loads(ukf(text, form, points)))
    rng = np.random.default_rng(5)
    for _ in range(40):
        u, z = rng.normal(size=1), rng.normal(size=2)
        assert kf.predict(u) == uf.predict(u) == 0
        assert kf.update("s", z) == uf.update("s", z) == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-10)
        assert uf.nis == pytest.approx(kf.nis, rel=1e-10)


@pytest.mark.parametrize("alpha", ["1e-2", "1e-3"])
@pytest.mark.parametrize("form", FORMS)
def test_small_alpha_costs_digits_only(alpha, form):
    text = random_problem(3, n=4, m=2)
    kf, uf = reference(loads(text)), reference(loads(ukf(text, form, f"{{kind: merwe, alpha: {alpha}}}")))
    rng = np.random.default_rng(5)
    for _ in range(20):
        u, z = rng.normal(size=1), rng.normal(size=2)
        assert kf.predict(u) == uf.predict(u) == 0
        assert kf.update("s", z) == uf.update("s", z) == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", FORMS)
def test_masks(kind, form):
    text = random_problem(7, n=3, m=3).replace("    R: ", "    partial: true\n    R: ")
    kf, uf = reference(loads(text)), reference(loads(ukf(text, form, KINDS[kind])))
    rng = np.random.default_rng(5)
    for mask in range(8):
        u, z = rng.normal(size=1), rng.normal(size=3)
        z[[i for i in range(3) if not mask >> i & 1]] = math.nan
        assert kf.predict(u) == uf.predict(u) == 0
        assert kf.update("s", z, mask=mask) == uf.update("s", z, mask=mask) == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-10)
        assert uf.nis == pytest.approx(kf.nis, rel=1e-10)


@pytest.mark.parametrize("points", [KINDS["merwe"], KINDS["cubature"], "{kind: merwe, alpha: 0.1}"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "text",
    [
        two_states(),
        two_states(var="0", r1="1"),
        two_states(var="0"),
        two_states(r2="0", h2="2*a"),
        two_states(r2="0", h2="a + b"),
        two_states(r1="1e30", r2="0", h2="a + b"),
        two_states(h2="b", r1="1e-8", r2="1e-3"),
        two_states().replace(", var: 0}", "}").replace(", var: 1}", "}").replace(
            "filter:", "    R: [[1, 1], [1, 1]]\nfilter:"
        ),
        two_states().replace("dynamics:", "covariances: [[a, b, 4]]\ndynamics:"),
        two_states(r1="1").replace("dynamics:", "covariances: [[a, b, -4]]\ndynamics:"),
    ],
)  # fmt: skip
def test_semidefinite(text, form, points):
    """Exact sensors and states, and such as repeat each other: the first component wins, as in a kf."""
    kf, uf = reference(loads(text)), reference(loads(ukf(text, form, points)))
    z = [3.0, 5.0]
    for _ in range(12):
        assert kf.update("s", z) == 0
        assert uf.update("s", z) & ~Status.REGULARIZED == 0
        np.testing.assert_allclose(uf.x, kf.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-12)
        assert uf.nis == pytest.approx(kf.nis, rel=1e-7, abs=1e-9)
        assert kf.predict() == 0
        assert uf.predict() & ~Status.REGULARIZED == 0
        np.testing.assert_allclose(uf.P, kf.P, rtol=1e-10, atol=1e-12)
        z = [z[0] + 1.0, z[1] - 2.0]


@pytest.mark.parametrize("form", FORMS)
def test_exact_sensors_count_once(form):
    text = SIX_SENSORS.replace("var: 1}", "var: 0}").replace("h: x,", "h: 0.3*x,").replace("1e6", "7.7")
    kf = reference(loads(ukf(text, form, "{kind: merwe, alpha: 0.1}")))
    assert kf.update("level", [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]) == (Status.REGULARIZED if form == "sqrt" else 0)
    assert kf.x[0] == pytest.approx(10.0, rel=1e-14)
    assert kf.P[0, 0] == 0.0
    assert kf.nis == pytest.approx(9.0 / (0.09 * 7.7))
    x = kf.x
    assert kf.update("level", [30.0] * 6) == 0
    np.testing.assert_array_equal(kf.x, x)
    assert (kf.nis, kf.log_likelihood) == (0.0, 0.0)


@pytest.mark.parametrize("points", [*KINDS.values(), "{kind: merwe, alpha: 1e-3}"])
@pytest.mark.parametrize("form", FORMS)
def test_never_excited_state(form, points):
    """A state without variance and without noise stays what it is, and keeps no covariance, for ever."""
    text = two_states(var="0", r1="1").replace("f: {a: a + b}", "f: {a: 1.1*a + 0.3*c, c: 0.9*c}")
    text = text.replace("dynamics:", "  c: {init: 1e3, var: 4}\ndynamics:").replace("var: 0}", "var: 0.1}", 1)
    text = text.replace("  f: {a", "  Q: {a: 0.01}\n  f: {a").replace("b: {init: 0", "b: {init: 12.3")
    uf, rng = reference(loads(ukf(text, form, points))), np.random.default_rng(2)
    for _ in range(60):
        assert uf.predict() == 0
        assert uf.update("s", [uf.x[0] + rng.normal(), 12.3 + rng.normal()]) == 0
        assert uf.x[1] == 12.3
        assert not np.any(uf.P[1])
        assert not np.any(uf.P[:, 1])


def test_continuous_linear_noise_inputs_and_densities():
    """Linear noise inputs are not carried; with `augment` they are, and the result is the same."""
    text = NOISE_INPUTS.replace("v*(1 + nv)*cos(th)", "-0.2*px + v*slip + nv").replace("th + e1*cos(th)", "th + e1")
    text = text.replace("px: v*", "px: -0.1*py + v*").replace("v*(1 + nv)*sin(th)", "-0.3*py + nv - 2*nw")
    text = text.replace(", kind: angle", "").replace(", bounds: [-0.2, 0.2]", "")
    kf = reference(loads(text))
    others = [
        reference(loads(ukf(text, f"{form}{augment}", points)))
        for form in FORMS
        for augment in ("", ", augment: true")
        for points in ("{kind: merwe, alpha: 0.5}", "{kind: cubature}")
    ]
    rng = np.random.default_rng(8)
    for _ in range(10):
        u = rng.normal(size=2)
        assert {f.predict(u, 0.1) for f in (kf, *others)} == {0}
        assert {f.update("gnss", [0.1, 0.3], u) for f in (kf, *others)} == {0}
        heading = [0.3 + kf.x[2]]
        assert {f.update("compass", heading) for f in (kf, *others)} == {0}
        for f in others:
            np.testing.assert_allclose(f.x, kf.x, rtol=1e-10, atol=1e-10)
            np.testing.assert_allclose(f.P, kf.P, rtol=1e-10, atol=1e-11)
