"""Unscented filters of linear models in the emitted C: the Kalman filter, with points and without; what is exact,
known, or never excited.
"""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from sigma_cases import CYCLE, FORMS, KINDS, points, unscented
from variants import built, compiled, generated, spec_with

from kfgen.generate import build
from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.status import ERROR, Status, describe

# two states with everything correlated, an input, noise inputs
LIKELIHOOD = "code: {log_likelihood: true}"
LINEAR = """
kfgen: 1
name: linear
scalar: double
dt: 0.1
states:
  x: {init: 1, var: 2}
  y: {init: -0.5, var: 1}
covariances: [[x, y, 0.75]]
inputs: {push: {}}
noise: {w: {std: 0.3}}
dynamics:
  form: discrete
  f: {x: 0.9*x + 0.3*y + 0.1*push + w, y: 0.8*y - 0.1*x + push - 0.5*w}
  Q: [[0.2, 0.05], [0.05, 0.1]]
measurements:
  s:
    z: {a: {h: x + 0.5*y}, b: {h: 2*y + n}}
    R: [[0.5, 0.1], [0.1, 0.3]]
    noise: {n: {var: 0.25}}
filter: {type: ukf}
"""
# so that there are points, which it leaves alone
BOUNDED = re.sub(r"inputs.*\n|noise: .*\n| +noise: .*\n", "", LINEAR).replace("var: 1}", "var: 1, bounds: [-1e6, 1e6]}")
BOUNDED = re.sub(r" [+-] (0.1\*|0.5\*)?(push|w|n)\b", "", BOUNDED)


@cache
def _kalman_filter(text: str) -> NativeFilter:
    return built({0: spec_with(text, "type: kf", "full-standard")})[0]


def kalman_filter(text: str) -> NativeFilter:
    return _kalman_filter(re.sub(", bounds: .*]", "", text)).copy()


def difference(kf: NativeFilter, other: NativeFilter) -> float:
    """The largest difference of x in sigma, of P, nis and log_likelihood relative, over a run of both."""
    random = np.random.default_rng(5)
    worst = 0.0
    for each in (kf, other):
        each.init()
    for _ in range(30):
        u, z = random.normal(size=1), random.normal(size=2)
        for each in (kf, other):
            assert each.predict(u if each.inputs else None) == 0
            assert each.update("s", z) & ~Status.REGULARIZED == 0
        sigma = np.sqrt(kf.P.diagonal())
        worst = max(
            worst, float(np.max(np.abs(kf.x - other.x) / sigma)),
            float(np.max(np.abs(kf.P - other.P) / np.outer(sigma, sigma))), abs(kf.nis / other.nis - 1),
            abs(kf.log_likelihood / other.log_likelihood - 1),
        )  # fmt: skip
    return worst


FACTORED = ("ud", "sequential", "sqrt")


@pytest.mark.parametrize(("which", "kind"), list(enumerate([*KINDS, "custom-centre", "custom-triangle"])))
def test_points_see_what_is_linear(which, kind):
    """As a kf has it, to 1e-10, in full and in one other form; weights of 1e6 cost six digits."""
    forms = ("full", FACTORED[which % 3])
    specs = {form: unscented(BOUNDED, form, points(kind), code=LIKELIHOOD) for form in forms}
    found = {form: difference(kalman_filter(BOUNDED), kf) for form, kf in built(specs).items()}
    print(found)
    assert max(found.values()) < (1e-7 if kind == "merwe-1e-3" else 1e-10), found


def test_points_of_negative_weight():
    kf = built({0: unscented(BOUNDED, "full", points("custom-negative"))})[0]
    assert difference(kalman_filter(BOUNDED), kf) < 1e-10


def test_linear_models_need_no_points():
    """Notes, counts and text say so; the whole filter is the same for all kinds."""
    ekf = dict(build(spec_with(LINEAR, "type: ekf", "full-standard")).summary.rows)
    kinds = {"merwe-0.1": tuple(FORMS), "cubature": ("ud", "sqrt"), "custom-centre": ("full",)}
    made = generated({
        (form, kind): unscented(LINEAR, form, points(kind)) for kind, forms in kinds.items() for form in forms
    })  # fmt: skip
    for (form, kind), each in made.items():
        name = each.code.model.spec.name
        assert "f is linear: no sigma points" in each.summary.notes, (form, kind)
        assert "h of s is linear: no sigma points" in each.summary.notes
        assert "points" not in each.files[f"{name}.c"].replace("sigma points", "").replace("custom points", "")
        assert f"{name}_f(" not in each.files[f"{name}.c"]
        assert f"{name}_see_s(" not in each.files[f"{name}.c"]
        if form == "full":
            assert dict(each.summary.rows) == ekf
    for key, kf in compiled(made).items():
        assert difference(kalman_filter(LINEAR), kf) < 1e-10, key


def test_what_is_not_linear_has_points():
    """In f or in h alone; kept points lack Q, so that they see even what is linear."""
    bent = LINEAR.replace("0.8*y", "0.8*sin(y)")
    notes = build(unscented(bent, "full")).summary.notes
    assert "h of s is linear: no sigma points" in notes
    assert "f is linear: no sigma points" not in notes
    notes = build(unscented(LINEAR.replace("h: 2*y", "h: 2*y*x"), "ud")).summary.notes
    assert "f is linear: no sigma points" in notes
    assert "h of s is linear: no sigma points" not in notes
    for options in (points("merwe", redraw=False), "augment: true"):
        assert not [note for note in build(unscented(LINEAR, "sqrt", options)).summary.notes if "no sigma" in note]


# semidefinite in every way: exact sensors, sensors that repeat each other, states that are known or one
TWO = """
kfgen: 1
name: two
scalar: double
dt: 1
parameters: {r1: 1, r2: 1}
states:
  a: {init: 0, bounds: [-1e9, 1e9]}
  b: {init: 0}
P0: P_ZERO
dynamics:
  form: discrete
  f: {a: a + b}
measurements:
  s:
    z: {z1: {h: a, var: R_ONE}, z2: {h: H_TWO, var: R_TWO}}
filter: {type: ukf}
"""
FOUR = "[[4, 0], [0, 4]]"
SEMIDEFINITE = {
    "one exact sensor": (FOUR, "0", "b", "1"),
    "the same, twice": (FOUR, "0", "2*a", "0"),
    "an exact sum": (FOUR, "1e30", "a + b", "0"),
    "nothing uncertain": ("[[0, 0], [0, 0]]", "1", "b", "0"),
    "two states that are one": ("[[4, 4], [4, 4]]", "0", "b", "1"),
    "two that are opposite": ("[[4, -4], [-4, 4]]", "1", "b", "1"),
}


@pytest.mark.parametrize("name", SEMIDEFINITE)
def test_semidefinite(name):
    """As a kf has it: variances of readings that are constant, and that are parameters."""
    P, r1, h2, r2 = SEMIDEFINITE[name]
    text = TWO.replace("P_ZERO", P).replace("H_TWO", h2)
    fixed, free = text.replace("R_ONE", r1).replace("R_TWO", r2), text.replace("R_ONE", "r1").replace("R_TWO", "r2")
    # sequential: H = Pxz^T P^-1 of a P that is nothing but round-off is arbitrary, and with it nis
    forms = [form for form in FORMS if form != "sequential" or name != "one exact sensor"]
    specs = {(form, "fixed"): unscented(fixed, form, points("merwe-0.1")) for form in forms}
    if r1 == "0":
        specs |= {(form, "free"): unscented(free, form, points("cubature")) for form in ("ud", "sqrt")}
    wrong = []
    for key, kf in built(specs).items():
        ref = reference(spec_with(fixed.replace(", bounds: [-1e9, 1e9]", ""), "type: kf", "full-joseph"))
        kf.parameters["r1"], kf.parameters["r2"] = float(r1), float(r2)
        z = [3.0, 5.0]
        for step in range(12):
            for call in ("update", "predict"):
                truth = ref.update("s", z) if call == "update" else ref.predict()
                status = kf.update("s", z) if call == "update" else kf.predict()
                close = (status | truth) & ~Status.REGULARIZED == 0
                close = close and np.allclose(kf.x, ref.x, 1e-9, 1e-9) and np.allclose(kf.P, ref.P, 1e-9, 1e-9)
                nis = kf.nis == pytest.approx(ref.nis, rel=1e-7, abs=1e-9)
                if not (close and nis):
                    wrong.append((key, step, call, describe(status), kf.x, ref.x, kf.P, ref.P, kf.nis, ref.nis))
            z = [z[0] + 1.0, z[1] - 2.0]
    assert not wrong, wrong[0]


# an exact reading and one that bends, of a system that is never quite known
EXACT = """
kfgen: 1
name: exact
scalar: double
dt: 0.1
states: {a: {init: 10, var: 0.01}, b: {init: 0.5, var: 0.04}}
dynamics:
  form: discrete
  f: {a: a + dt*b, b: "0.95*b - 0.02*b*b + 0.01"}
  Q: {b: 0.01}
measurements:
  s:
    z: {z1: {h: H_ONE, var: 0}, z2: {h: a + b*b, var: 0.01}}
filter: {type: ukf}
"""
# of points with negative weights where h is linear: where it bends, S may be negative
SENSORS = [("a", "merwe"), ("a*a/10", "cubature")]


@pytest.mark.parametrize(("h", "kind"), SENSORS)
def test_an_exact_sensor(h, kind):
    """It leaves nothing of one state's variance, takes nothing but what it should of the other's, and never fails."""
    text = EXACT.replace("H_ONE", h)
    wrong = []
    for form, kf in built({form: unscented(text, form, points(kind)) for form in FORMS}).items():
        ref = reference(unscented(text, form, points(kind)))
        random = np.random.default_rng(1)
        a, b = 10.1, 0.6
        for step in range(20):
            a, b = a + 0.1 * b, 0.95 * b - 0.02 * b * b + 0.01 + 0.1 * random.normal()
            z = [a if h == "a" else a * a / 10, a + b * b + 0.1 * random.normal()]
            found = kf.predict() | kf.update("s", z), ref.predict() | ref.update("s", z)
            sigma = np.sqrt(np.max(ref.P.diagonal()))
            errors = np.max(np.abs(kf.x - ref.x)) / sigma, np.max(np.abs(kf.P - ref.P)) / sigma**2
            if (found[0] | found[1]) >= ERROR or max(errors) > 1e-5:
                wrong.append((form, step, *map(describe, found), errors, kf.P, ref.P))
    assert not wrong, wrong[0]


# b is known, and nothing disturbs it
STILL = CYCLE.replace("covariances", "  b: {init: 0.3, var: 0}\ncovariances").replace("- x)}", "- x + b)}").replace(
    "h: x +", "h: x + b*x/8 +")  # fmt: skip


def test_a_state_that_is_never_excited():
    """100 000 steps: it stays to the last bit, its variance and covariances are 0."""
    random = np.random.default_rng(3)
    steps = 100_000
    z = random.normal(0, [0.8, 1.0], (steps, 2))
    kinds = {"full": "julier-minus", "ud": "cubature", "sequential": "merwe-0.1", "sqrt": "julier-minus"}
    specs = {form: unscented(STILL, form, points(kind), "float") for form, kind in kinds.items()}
    for form, kf in built(specs, ("-O1",)).items():
        result = kf.run({"fix.a": z[:, 0], "fix.b": z[:, 1]})
        assert (result.status < ERROR).all(), (form, result.counts())
        assert (result.x[:, 2] == np.float32(0.3)).all(), form
        assert (result.var[:, 2] == 0).all(), form
        assert not kf.P[2].any()
        assert (result.var[:, :2] > 0).all(), form
        assert np.isfinite(result.x).all(), form
