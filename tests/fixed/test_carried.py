"""Filters whose noise is below the LSB: what is rounded away in one step is made up for in the next."""

from __future__ import annotations

import numpy as np
import pytest
from test_filters import follow

import kfgen
from kfgen.generate import build
from kfgen.override import override
from kfgen.spec.loading import loads
from kfgen.status import Status

HEAD = "kfgen: 1\nscalar: q16.16\n"
CONSTANT = HEAD + """
name: constant
dt: 1
states: {c: {init: 0, std: 1}}
dynamics: {form: discrete, f: {c: c}}
measurements: {m: {z: {y: {h: c, std: 1}}}}
filter: {type: kf}
"""
WALK = HEAD + """
name: walk
dt: 1
states: {c: {init: 0, std: 1}}
dynamics: {form: discrete, f: {c: c}, Q: {c: 1e-9}}
measurements: {m: {z: {y: {h: c, std: 0.5}}}}
filter: {type: ekf}
"""
GYRO = HEAD + """
name: gyro
dt: 0.01
states: {a: {init: 0, std: 1}, b: {init: 0, std: 0.1, bounds: [-1, 1]}}
inputs: {g: {range: [-5, 5]}}
dynamics: {form: discrete, f: {a: a + (g - b)*dt}, Q: {a: 1e-8, b: 1e-13}}
measurements: {m: {z: {y: {h: a, std: 0.05}}}}
filter: {type: kf}
"""
FORMS = [("ud", "bierman"), ("full", "standard"), ("full", "joseph")]
CASES = [(CONSTANT, *FORMS[0]), (WALK, *FORMS[1]), *((GYRO, *form) for form in FORMS)]
STD = {"constant": 1.0, "walk": 0.5, "gyro": 0.05}
STEPS = 20_000


@pytest.fixture(scope="module")
def filters():
    """Each in q16.16 beside double."""
    specs = []
    for text, covariance, update in CASES:
        spec = override(loads(text), filter={"covariance": covariance, "update": update})
        specs += [spec, override(spec, "double")]
    made = kfgen.compile_many(specs)
    return list(zip(made[::2], made[1::2], strict=True))


@pytest.mark.parametrize("case", range(len(CASES)), ids=[f"{c[0].split()[5]}-{c[1]}-{c[2]}" for c in CASES])
def test_small_noise_is_not_lost(filters, case):
    """Over thousands of steps the estimate and its standard deviation stay those of float64."""
    q, exact = filters[case]
    random = np.random.default_rng(case)
    t = np.arange(STEPS) * (0.01 if q.inputs else 1.0)
    g, std = np.sin(t), STD[q.name.split("_")[0]]
    truth = 1 - np.cos(t) if q.inputs else np.full(STEPS, 0.7)
    log = {"t": t, "g": g + 0.05, "m.y": truth + std * random.standard_normal(STEPS)}
    log = {name: column for name, column in log.items() if name in ("t", *q.inputs, "m.y")}
    result, wanted = q.run(log), exact.run(log)
    assert not np.any(result.status)
    assert np.max(np.abs(result.x - wanted.x) / np.sqrt(wanted.var)) < 0.1
    assert np.max(np.abs(np.sqrt(result.var[100:] / wanted.var[100:]) - 1)) < 0.05


@pytest.mark.parametrize("covariance", ["ud", "full"])
def test_interpreter_and_c_agree(covariance):
    assert follow(GYRO, covariance=covariance) < 0.02


def test_a_bound_holds_beyond_what_the_runs_have_met(filters):
    q = filters[2][0].copy()
    q.init()
    q.set_state([0.0, 0.9])
    for k in range(100):
        q.predict([0.0])
        q.update("m", [-0.1 * k])
    assert q.x[1] == 1.0


def test_what_is_given_forgets_the_rest(filters):
    q = filters[2][0].copy()
    q.init()
    for _ in range(50):
        q.predict([1.0])
        q.update("m", [0.3])
    assert np.any(q.raw["rest"])
    q.set_state(q.x)
    q.set_covariance(q.P)
    assert not np.any(q.raw["rest"])


def test_others_pay_nothing():
    spec = override(loads(WALK.replace("1e-9", "1e-3")))
    assert "rest" not in build(spec).files["walk.h"]


def test_it_is_said():
    made = build(loads(GYRO)).files["gyro.h"]
    assert "rounding carried on" in made


def test_extremes_saturate(filters):
    q = filters[0][0].copy()
    q.init()
    q.predict()
    assert q.update("m", [1e30]) & Status.SATURATED
    assert np.all(np.isfinite(q.x))
