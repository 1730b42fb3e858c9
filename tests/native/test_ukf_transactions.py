"""Unscented filters: after an error, and after a gated update, all is what it was, kept points included; and they
run for ever.

A failure here is the algorithm's: a guard is missing, or stands behind a store.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest
from calling import Calls, refused
from sigma_cases import (
    CYCLE,
    FORMS,
    HEADING,
    MULTIPLIED,
    PENDULUM,
    TANK,
    WHOLE,
    join,
    points,
    put_back,
    unscented,
)
from variants import built

from kfgen.errors import SpecError
from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR, Status, describe

BAD = (math.nan, math.inf, -math.inf)
KEPT = {"x", "P", "U", "D", "S", "R_fix", "R_tip", "residual_fix", "residual_tip", "points"}
VARIANTS = [
    (CYCLE, "full", join("adaptive: {chi2: 1}, adapt_R: 0.05", points("merwe-0.1", redraw=False))),
    (CYCLE, "ud", points("cubature", redraw=False)),
    (CYCLE, "sqrt", join("adaptive: {chi2: 1}", points("custom-centre", redraw=False))),
    (MULTIPLIED, "full", points("merwe-0.1")),
    (MULTIPLIED, "sequential", join("robust: chernodarov", points("julier-1"))),
    (HEADING, "sqrt", points("julier-minus")),
    (TANK, "ud", join("reject: non_finite", points("merwe"))),
]


@cache
def _filters() -> list[NativeFilter]:
    return list(built({key: unscented(*key, "float") for key in VARIANTS}).values())


def moved() -> Iterator[tuple[NativeFilter, NativeFilter, Calls]]:
    """Filters that have made an update and a prediction, and copies to return to."""
    for kf in _filters():
        kf.init()
        calls = Calls(kf)
        sensor = next(iter(calls.updates))
        z = {"compass": [3.1, 3.1, 179.0]}.get(calls.updates[sensor], [1.2, 0.3][: len(calls.vectors[sensor]["z"])])
        assert calls("predict") < ERROR
        assert calls(sensor, z=np.array(z)) < ERROR, kf
        assert calls("predict") < ERROR
        for name in calls.updates:
            calls.vectors[name]["z"] = np.array(z)
        yield kf, kf.copy(), calls


def test_wrong_arguments():
    """NULL, NaN and infinity in every argument."""
    for _, _, calls in moved():
        for name in calls.names:
            refused(calls, Status.NULL_ARGUMENT, name, kf=None)
            for key, good in calls.vectors[name].items():
                if key == "mask":
                    continue
                refused(calls, Status.NULL_ARGUMENT, name, **{key: None})
                for i, bad in itertools.product(range(len(good)), BAD):
                    if calls.leaves(name, key, i):
                        continue
                    wrong = good.copy()
                    wrong[i] = bad
                    refused(calls, Status.NOT_FINITE, name, **{key: wrong})


def test_spoiled_filters():
    """NaN and infinity in what is kept: refused without a change, or without a trace in the state."""
    for kf, good, calls in moved():
        for field in sorted(kf.struct.fields & KEPT):
            for index, bad in itertools.product(range(len(kf.raw[field])), BAD):
                for name in ("predict", *calls.updates):
                    put_back(kf, good)
                    getattr(kf.struct.data, field)[index] = bad
                    before, x = bytes(kf), kf.x
                    status = calls(name)
                    place = f"{kf}: {field}[{index}] = {bad}, {name}: {describe(status)}"
                    if status >= ERROR:
                        assert bytes(kf) == before, place
                    elif status != Status.GATED:
                        assert np.isfinite(kf.x[np.isfinite(x)]).all(), place


def test_what_is_far_too_large():
    """Readings up to the end of a float's range: refused, gated, or everything that the filter keeps is finite."""
    met, wrong = set(), []
    for kf, good, calls in moved():
        for name, size in itertools.product(calls.updates, 10.0 ** np.arange(2, 39, 3)):
            put_back(kf, good)
            before = bytes(kf)
            status = calls(name, z=size * np.ones(len(calls.vectors[name]["z"])))
            met.add(status)
            if status >= ERROR:
                assert bytes(kf) == before
            elif status != Status.GATED:
                bad = {f: v for f, v in kf.raw.items() if f in KEPT and not np.isfinite(v).all()}
                if bad:
                    wrong.append(f"{kf}: {name}({size}): {describe(status)}, {bad}")
    assert not wrong, "\n".join(wrong[:8])
    assert {Status.NOT_FINITE, Status.GATED} < met


def test_a_gated_update():
    """GATED alone; nis and the count of rejections have changed, and a later update sees the kept points."""
    for kf, good, calls in moved():
        if kf.spec.measurements[0].gate is None:
            continue
        name, sensor = next(iter(calls.updates.items()))
        z = np.full(len(calls.vectors[name]["z"]), 9.0)
        before = kf.copy()
        assert calls(name, z=z) == Status.GATED, kf
        assert kf.gate_count[sensor] == before.gate_count[sensor] + 1
        assert kf.nis > 13
        for field in kf.struct.fields & {"nis", f"gate_count_{sensor}"}:
            setattr(kf.struct.data, field, getattr(before.struct.data, field))
        assert bytes(kf) == bytes(before), kf
        if "kept" in kf.struct.fields:
            assert kf.raw["kept"]
        other = good.copy()
        assert calls(name) == other.update(sensor, calls.vectors[name]["z"]) < ERROR
        assert bytes(kf) == bytes(other)
        if "kept" in kf.struct.fields:
            assert not kf.raw["kept"]


@pytest.mark.parametrize("form", FORMS)
def test_the_floor_of_a_gated_innovation(form):
    """What the floor does to an innovation variance that only judges is not told."""
    kf = built({0: unscented(CYCLE, form, "innovation_floor: 2")})[0]
    assert kf.update("fix", [60.0, 0.0]) == Status.GATED
    assert kf.update("fix", [1.5, 0.3]) == Status.REGULARIZED


@pytest.mark.parametrize("form", WHOLE)
def test_the_floor_of_an_inflated_innovation(form):
    """The flag is that of the update that is made: its variance is above the floor by itself."""
    text = CYCLE.replace("    gate: {probability: 0.999, reset_after: 1}\n", "")
    spec = unscented(text, form, "innovation_floor: 0.2, adaptive: {chi2: 1}")
    kf, ref = built({0: spec})[0], reference(spec)
    assert kf.update("fix", [9.0, 5.0]) == ref.update("fix", [9.0, 5.0]) == Status.ANOMALY


def test_kept_points_end():
    """Whatever replaces the estimate makes the next update draw its own."""
    kf = built({0: unscented(CYCLE, "full", points("julier-1", redraw=False))})[0]
    drawn = built({0: unscented(CYCLE, "full", points("julier-1"))})[0]
    z = [1.6, 0.2]
    spoil = {
        "nothing": lambda: 0,
        "init": kf.init,
        "set_state": lambda: kf.set_state(kf.x),
        "set_covariance": lambda: kf.set_covariance(kf.P),
        "redraw": kf.redraw,
        "update": lambda: kf.update("fix", z),
    }
    for name, action in spoil.items():
        assert kf.init() == kf.predict() == 0
        assert kf.raw["kept"]
        assert kf.update("fix", [math.nan, 0.0]) == Status.NOT_FINITE
        assert kf.raw["kept"]
        assert action() == 0
        assert bool(kf.raw["kept"]) == (name == "nothing"), name
        assert drawn.set_state(kf.x) == drawn.set_covariance(kf.P) == 0
        assert kf.update("fix", z) == drawn.update("fix", z) == 0
        away = np.max(np.abs(kf.x - drawn.x))
        assert (away > 1e-6) == (name == "nothing"), (name, away)


@pytest.mark.parametrize("form", WHOLE)
def test_covariances_that_come_out_indefinite(form):
    """A centre of weight -19: x^2 of P has the mean P and the variance -0.9 P^2. Noise makes up for it."""
    text = """
kfgen: 1
name: sunk
scalar: double
parameters: {q: 0, r: 0}
states: {x: {init: 0, var: 0.5}, y: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: "x**2", y: "y"}, Q: {x: q}}
measurements:
  fix: {z: {a: {h: "x**2", var: r}}}
filter: {type: ukf}
"""
    options = "sigma_points: {kind: julier, kappa: -1.9, redraw: false}"
    kf = built({0: unscented(text, form, options)})[0]
    calls = Calls(kf)
    refused(calls, Status.NOT_POSITIVE, "predict")
    refused(calls, Status.NOT_POSITIVE, "update_fix", z=np.array([0.1]))
    kf.parameters["q"] = 1.0
    assert kf.predict() == 0
    assert kf.P[0, 0] == pytest.approx(1.0 - 0.9 * 0.25)
    assert kf.raw["kept"]
    kf.parameters["q"] = -5.0
    refused(calls, Status.NOT_POSITIVE, "predict")
    kf.parameters["r"] = -5.0
    refused(calls, Status.NOT_POSITIVE, "update_fix", z=np.array([0.1]))
    kf.init()
    kf.parameters["r"] = 9.0
    assert kf.update("fix", [0.1]) == 0


def test_points_that_are_no_numbers():
    """Of the prediction: an error, or replaced where the spec has it; those of the measurement: an error."""
    text = TANK.replace(", bounds: [0, 5]", "").replace("init: 1,", "init: 0.2,")
    options = {"full": ("", 'reject: "x > 0.2"'), "ud": ("", "reject: non_finite"), "sqrt": ("reject: non_finite",)}
    specs = {(form, each): unscented(text, form, each) for form in options for each in options[form]}
    for (_, each), kf in built(specs).items():
        if each:
            assert kf.predict() == Status.POINT_REJECTED
            kf.init()
        else:
            refused(Calls(kf), Status.NOT_FINITE, "predict")
        refused(Calls(kf), Status.NOT_FINITE, "update_level", z=np.array([0.4]))


def test_a_rejected_centre():
    """The centre is never replaced: where it is rejected itself nothing happens, where it is no number it is an
    error."""
    text = TANK.replace(", bounds: [0, 5]", "").replace("x - 0.3*sqrt(x) + 0.1*y**2", "x/(x - p)").replace(
        "dynamics:", "parameters: {p: 9}\ndynamics:"
    )  # fmt: skip
    options = "reject: abs(x) > 0"
    for form, kf in built({form: unscented(text, form, options) for form in WHOLE}).items():
        ref = reference(unscented(text, form, options))
        for each in (kf, ref):
            assert each.set_state([1.0, 0.1]) == each.set_covariance([[0.01, 0], [0, 0.01]]) == 0
        assert kf.predict() == ref.predict() == Status.POINT_REJECTED
        np.testing.assert_allclose(kf.x, ref.x, rtol=1e-12)
        np.testing.assert_allclose(kf.P, ref.P, atol=1e-15)
        kf.set_state([1.0, 0.1])
        kf.parameters["p"] = 1.0
        refused(Calls(kf), Status.NOT_FINITE, "predict")


def test_a_million_steps():
    """A pendulum in float, with gaps: finite and positive to the end."""
    steps = 1_000_000
    random = np.random.default_rng(8)
    angle = 0.5 * np.sin(3.1 * 0.05 * np.arange(steps))
    log = {
        "torque": np.zeros(steps),
        "tip.x": np.sin(angle) + random.normal(0, 0.14, steps),
        "tip.y": -np.cos(angle) + random.normal(0, 0.1, steps),
    }
    log["tip.y"][random.random(steps) < 0.1] = np.nan
    specs = {
        key: unscented(PENDULUM, key[0], points(key[1]), "float") for key in (("sqrt", "merwe"), ("ud", "cubature"))
    }
    for key, kf in built(specs, ("-O2",)).items():
        result = kf.run(log)
        assert (result.status < ERROR).all(), (key, result.counts())
        assert np.isfinite(result.x).all(), key
        assert np.isfinite(result.var).all(), key
        assert (result.var > 0).all(), key
        assert np.sqrt(np.mean((result.x[:, 0] - angle) ** 2)) < 0.2, key
        assert np.linalg.eigvalsh(kf.P)[0] > 0, key


BEYOND = ("[[1, 2], [2, 1]]", "[[1, 1.01], [1.01, 1]]", "[[0, 0.1], [0.1, 1]]", "[[1, 0], [0, -0.001]]")


@pytest.mark.parametrize("form", FORMS)
def test_covariances_that_are_none(form):
    """Given to a filter they leave it as it is; in a spec they are refused, with the pair that cannot be."""
    kinds = ["", "{kind: cubature}"] + (["{redraw: false}"] if form == "full" else [])
    cases = {(kind, how, scalar): unscented(CYCLE, form, f"sigma_points: {kind}" if kind else "", scalar,
                                            f"code: {{unroll: {how}}}")
             for kind in kinds for how in ("full", "none") for scalar in ("float", "double")}  # fmt: skip
    for kf in built(cases).values():
        calls = Calls(kf)
        assert kf.predict() == 0
        for P in BEYOND:
            refused(calls, Status.NOT_POSITIVE, "set_covariance", P=np.array(json.loads(P), dtype=float).ravel())
    plain = CYCLE.replace(", std: 0.3", "").replace(", std: 0.2}\ncov", "}\ncov")
    for P in BEYOND[:3]:
        with pytest.raises(SpecError, match="`x` and `y`"):
            loads(re.sub("covariances: .*", f"P0: {P}", plain))
