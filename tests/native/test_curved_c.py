"""iekf and ekf2 in the emitted C against facts: the posterior's mode, moments in closed form, linear models."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from emitted import problems
from scipy.optimize import least_squares
from variants import FORMS, built, compiled, generated, spec_with

from kfgen.generate import Generated
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import Status

BEACONS = np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 5.0]])
PRIOR, P0 = np.array([1.5, 3.5]), np.array([[4.0, 1.0], [1.0, 4.0]])
R = np.array([[0.04, 0.01, 0], [0.01, 0.04, 0], [0, 0, 0.09]])
RANGES = f"""
kfgen: 1
name: ranges
states:
  x: {{init: 1.5, std: 2}}
  y: {{init: 3.5, std: 2}}
covariances: [[x, y, 1]]
dynamics: {{form: discrete, f: {{}}}}
measurements:
  s:
    z:
      a: {{h: "hypot(x, y)"}}
      b: {{h: "hypot(x - 4, y)"}}
      c: {{h: "hypot(x - 1, y - 5)"}}
    R: {R.tolist()}
filter: {{type: iekf}}
"""


def ranges(x):
    d = x - BEACONS
    return np.hypot(d[:, 0], d[:, 1]), d / np.hypot(d[:, 0], d[:, 1])[:, None]


def test_the_posterior_mode():
    """Ranges alone, a prior that is far off: the iteration ends where the sum of squares is least."""
    white_P, white_R = np.linalg.inv(np.linalg.cholesky(P0)), np.linalg.inv(np.linalg.cholesky(R))
    forms = ["ud-bierman", "full-joseph", "full-standard", "sqrt"]
    filters = built({form: spec_with(RANGES, "type: iekf, iterations: 12", form) for form in forms})
    for truth in ((2.5, 1.5), (3.0, 4.0), (0.5, 2.5)):
        z = ranges(np.array(truth))[0] + [0.05, -0.05, 0.1]
        best = least_squares(
            lambda x, z=z: np.concatenate([white_P @ (x - PRIOR), white_R @ (z - ranges(x)[0])]), PRIOR,
            jac=lambda x: np.vstack([white_P, -white_R @ ranges(x)[1]]), xtol=1e-15, ftol=1e-15, gtol=1e-15,
        ).x  # fmt: skip
        H = ranges(best)[1]
        P = np.linalg.inv(np.linalg.inv(P0) + H.T @ np.linalg.solve(R, H))
        y, H0 = z - ranges(PRIOR)[0], ranges(PRIOR)[1]
        nis = y @ np.linalg.solve(H0 @ P0 @ H0.T + R, y)
        for form, kf in filters.items():
            kf.init()
            assert kf.update("s", z) == 0
            np.testing.assert_allclose(kf.x, best, rtol=1e-9, err_msg=form)
            np.testing.assert_allclose(kf.P, P, rtol=1e-8, err_msg=form)
            assert kf.nis == pytest.approx(nis, rel=1e-9)  # of the first linearisation


def one(f: str = "x", z: str = "{h: x, var: 1}", extra: str = "", Q: str = "0.1") -> str:
    return problems.one_state(f"  form: discrete\n  f: {{x: {f}}}\n  Q: {{x: {Q}}}", z=z, extra=extra)


NOISES = "noise: {w: {}, v: {}}\nnoise_covariance: [[0.3, 0.1], [0.1, 0.4]]"
MORE = "\n    noise: {a: {}, b: {}}\n    noise_covariance: [[0.3, 0.1], [0.1, 0.4]]"
# of x' for x = 2, P = 0.5, var w = 0.3, var v = 0.4, cov(w, v) = 0.1, Q = 0.1
PREDICTED = {
    "x**2": (4 + 0.5, 16 * 0.5 + 2 * 0.25),
    "x*(1 + w)": (2.0, 0.5 + 4 * 0.3 + 0.5 * 0.3),
    "x + w**2": (2.0 + 0.3, 0.5 + 2 * 0.09),
    "x + w*v": (2.0 + 0.1, 0.5 + 0.3 * 0.4 + 0.01),
}
# of z for the same x; r = 0.2, var a = 0.3, var b = 0.4, cov(a, b) = 0.1: mean, variance, covariance with x
MEASURED = {
    "x**2": (4 + 0.5, 16 * 0.5 + 2 * 0.25 + 0.2, 4 * 0.5),
    "x*(1 + a) + a*b": (2.1, 0.5 + 4 * 0.3 + 0.2 + (0.5 * 0.3 + 0.3 * 0.4 + 0.01), 0.5),
}


def test_moments_in_closed_form():
    """Quadratic and bilinear models: second-order moments are exact."""
    specs = {}
    for k, form in enumerate(FORMS):
        for f in {"x**2", [*PREDICTED][k % 4]}:
            specs[form, "predict", f] = spec_with(one(f, extra=NOISES), "type: ekf2", form)
        h = [*MEASURED][k % 2]
        specs[form, "update", h] = spec_with(one(z=f"{{h: {h}, var: 0.2}}{MORE}"), "type: ekf2", form)
    for (form, what, formula), kf in built(specs).items():
        kf.set_state([2.0])
        if what == "predict":
            mean, variance = PREDICTED[formula]
            assert kf.predict() == 0
            assert kf.x[0] == pytest.approx(mean, rel=1e-14), (form, formula)
            assert kf.P[0, 0] == pytest.approx(variance + 0.1, rel=1e-14), (form, formula)
            continue
        mean, S, cross = MEASURED[formula]
        y = 5.5 - mean
        assert kf.update("s", [5.5]) == 0
        assert kf.x[0] == pytest.approx(2 + cross / S * y, rel=1e-13), (form, formula)
        assert kf.P[0, 0] == pytest.approx(0.5 - cross**2 / S, rel=1e-13), (form, formula)
        assert kf.nis == pytest.approx(y**2 / S, rel=1e-13), (form, formula)
        likelihood = -0.5 * (math.log(2 * math.pi * S) + y**2 / S)
        assert kf.log_likelihood == pytest.approx(likelihood, rel=1e-12), (form, formula)


def test_curvature_that_two_sensors_share():
    """x^2 measured twice and exactly: the curvature is one for both, the second reading adds nothing."""
    text = one(z="{h: x**2, var: 0}\n      z2: {h: x**2, var: 0}")
    for form, kf in built({form: spec_with(text, "type: ekf2", form) for form in FORMS}).items():
        assert kf.update("s", [2.0, 2.0]) == 0, form
        assert kf.x[0] == pytest.approx(1.0 + 1.0 / 2.5 * 0.5, rel=1e-13), form
        assert kf.P[0, 0] == pytest.approx(0.5 - 1.0 / 2.5, rel=1e-12), form
        kf.set_covariance([[0.0]])
        x = kf.x[0]
        assert kf.update("s", [3.0, 3.0]) == 0, form
        assert (kf.x[0], kf.P[0, 0], kf.nis) == (x, 0, 0), form


LINEAR = {
    "cv4": problems.CV4,
    "mixed": """
kfgen: 1
name: mixed
dt: 0.5
states: {a: {init: 1, var: 1}, b: {init: 0, var: 2}, th: {init: 3, var: 0.25, kind: angle}}
inputs: {u: {}}
noise: {w: {var: 0.1}}
dynamics: {form: discrete, f: {a: a + dt*b + u, b: 0.9*b + w, th: th + dt*b}, Q: {a: 0.1}}
measurements:
  s:
    z: {p: {h: a + b}, q: {h: a - 0.5*b + 0.5*n}, r: {h: th, kind: angle}}
    R: [[1, 0.25, 0], [0.25, 1, 0], [0, 0, 0.1]]
    noise: {n: {var: 0.3}}
    gate: {probability: 0.9999}
filter: {type: ekf}
""",
}  # fmt: skip


@pytest.mark.parametrize(("name", "form"), [("cv4", "ud-bierman"), ("mixed", "full-joseph"), ("mixed", "sqrt")])
def test_linear_models(name, form):
    """Nothing is curved: ekf2 is the ekf, operation by operation; iekf is its number by number."""
    kinds = ("ekf", "ekf2", "iekf, iterations: 2")
    made = generated({kind: spec_with(LINEAR[name], f"type: {kind}", form) for kind in kinds})
    first, second = made["ekf"], made["ekf2"]
    assert second.summary.rows == first.summary.rows
    assert second.summary.ram == first.summary.ram
    assert code_of(first) == code_of(second)
    filters = compiled(made)
    kf, others = filters.pop("ekf"), filters.values()
    random = np.random.default_rng(6)
    for _ in range(12):
        u = [random.normal()] if kf.inputs else None
        sensor = next(iter(kf.sensors))
        z = random.normal(size=len(kf.components(sensor)))
        for each in (kf, *others):
            each.predict(u)
        status = kf.update(sensor, z)
        sigma = np.sqrt(kf.P.diagonal())
        for other in others:
            assert other.update(sensor, z) == status
            assert np.max(np.abs(other.x - kf.x) / sigma) < 1e-12
            assert np.max(np.abs(other.P - kf.P) / np.outer(sigma, sigma)) < 1e-12
            assert other.nis == pytest.approx(kf.nis, rel=1e-12)
            assert other.log_likelihood == pytest.approx(kf.log_likelihood, rel=1e-12)


def code_of(made: Generated) -> str:
    """The C without comments and without the filter's name, which may change where lines break."""
    name = made.code.model.spec.name
    text = re.sub(r"/\*.*?\*/", "", made.files[f"{name}.c"], flags=re.DOTALL)
    return " ".join(text.replace(name, "NAME").replace(name.upper(), "NAME").split())


def test_a_row_that_vanishes():
    """h = x^2 at x = 0 sees nothing there: the update changes nothing, and makes no NaN of 0/0."""
    text = problems.one_state(
        "  form: discrete\n  f: {x: x, y: 0.5*x + y}\n  Q: {x: 0.1}", z="{h: x**2, var: 0.5}",
        states="  y: {init: 1, var: 2}", extra="covariances: [[x, y, 0.25]]",
    )  # fmt: skip
    cases = [(form, "type: ekf", text.replace("var: 0.5}\nfilter", "var: 0}\nfilter")) for form in FORMS]
    cases += [(form, "robust: chernodarov, adaptive: true", text) for form in FORMS]
    cases += [("full-standard", each, text) for each in ("type: ekf", "type: iekf, iterations: 2")]
    specs = {case: spec_with(case[2], case[1], case[0]) for case in cases}
    for (form, each, which), kf in built(specs).items():
        kf.set_state([0.0, 1.0])
        P = kf.P
        assert kf.update("s", [0.25]) == 0, (form, each)
        np.testing.assert_array_equal(kf.x, [0, 1], err_msg=form)
        np.testing.assert_allclose(kf.P, P, rtol=1e-15, err_msg=f"{form}, {each}")
        assert kf.nis == pytest.approx(0.25**2 / 0.5 if which == text else 0.0), (form, each)
        assert kf.predict() == 0
        assert kf.update("s", [0.25]) in (0, Status.REGULARIZED)


def test_an_infinite_bend():
    """The second derivative is infinite at 0: NOT_FINITE, and the filter stays."""
    specs = {}
    for form in ("ud-joseph", "full-standard", "sqrt"):
        specs[form, "f"] = spec_with(one("abs(x)**1.5"), "type: ekf2", form, "float")
        specs[form, "h"] = spec_with(one(z="{h: abs(x)**1.5, var: 1}"), "type: ekf2", form, "float")
    for (form, what), kf in built(specs).items():
        kf.set_state([0.0])
        before = bytes(kf)
        assert (kf.predict() if what == "f" else kf.update("s", [1.0])) == Status.NOT_FINITE, form
        assert bytes(kf) == before
        assert (kf.update("s", [1.0]) if what == "f" else kf.predict()) == 0  # the other one does not care


@pytest.mark.parametrize("scalar", ["double", "float", "q16.16"])
@pytest.mark.parametrize("start", [-1, 0, 2])
def test_a_table_has_the_inner_slope_at_its_ends(start, scalar):
    """A filter that starts there is not deaf."""
    text = problems.one_state("  form: discrete\n  f: {x: x}", z='{h: "table(x, [-1, 0, 2], [3, 1, 2])", var: 0.5}')
    text = text.replace("init: 1", f"init: {start}")
    slope, height = (-2.0, 3.0) if start < 0 else (0.5, 1.0 if start == 0 else 2.0)
    gain = 0.5 * slope / (0.5 * slope**2 + 0.5)
    for kf in (*built({0: spec_with(text, "type: ekf", "full-standard", scalar)}).values(), reference(loads(text))):
        assert kf.update("s", [height + 0.6]) == 0
        assert kf.x[0] == pytest.approx(start + 0.6 * gain, rel=1e-6, abs=3e-4 if scalar == "q16.16" else 0.0)
