"""After an error, and after a gated update, the filter is what it was: bit for bit, in every form.

A failure here is the algorithm's: a guard is missing, or stands behind a store.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from calling import Calls, refused
from emitted import ALL, EXACT, FORMS, GROUPS, SCALARS, library

from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.override import override
from kfgen.spec import loads
from kfgen.status import ERROR, Status

BAD = (math.nan, math.inf, -math.inf)
ERRORS = (0, int(Status.NULL_ARGUMENT), int(Status.NOT_FINITE), int(Status.NOT_POSITIVE))


@pytest.mark.parametrize(("form", "scalar"), [*((form, "float") for form in FORMS), ("ud-bierman", "double")])
def test_wrong_arguments(form, scalar):
    for group in ("exact", "libm") if scalar == "float" else ("exact",):
        for kf in library(group, form, scalar).values():
            calls = Calls(kf)
            for name in calls.names[:-2]:  # out of the initial state, so that there is something to spoil
                calls(name)
            for name in calls.names:
                refused(calls, Status.NULL_ARGUMENT, name, kf=None)
                for key, good in calls.vectors[name].items():
                    if key not in ("dt", "mask"):
                        refused(calls, Status.NULL_ARGUMENT, name, **{key: None})
                    for i in range(0 if key == "mask" else len(good)):
                        for bad in BAD:
                            wrong = good.copy()
                            wrong[i] = bad
                            if calls.leaves(name, key, i):
                                assert calls(name, **{key: wrong}) < ERROR
                                continue
                            refused(calls, Status.NOT_FINITE, name, **{key: wrong})
                            if "u" in calls.vectors[name] and key == "z":  # the first of all that is wrong
                                refused(calls, Status.NULL_ARGUMENT, name, **{key: wrong, "u": None})
            n = len(kf.states)
            out = kf.struct.ffi.new(f"{kf.name}_real_t[]", n * n)
            getattr(kf.struct.lib, f"{kf.name}_get_covariance")(kf.struct.data, kf.struct.ffi.NULL)
            getattr(kf.struct.lib, f"{kf.name}_get_covariance")(kf.struct.ffi.NULL, out)
            assert getattr(kf.struct.lib, f"{kf.name}_init")(kf.struct.ffi.NULL) == Status.NULL_ARGUMENT


@pytest.mark.parametrize("form", FORMS)
def test_steps_that_are_none(form):
    filters = library("exact", form, "float")
    free, limited = Calls(filters["free_step"]), Calls(filters["run_time"])
    for dt in (0.0, -0.0, -1.0, -1e-40):
        refused(free, Status.NOT_POSITIVE, "predict", dt=np.array([dt]))
        assert limited.kf.predict([0.1], dt) == Status.DT_CLAMPED
    copy = limited.kf.copy()
    assert limited.kf.predict([0.1], -5) == copy.predict([0.1], 1e-3) == Status.DT_CLAMPED
    assert bytes(limited.kf) == bytes(copy)
    refused(limited, Status.NOT_FINITE, "predict", dt=np.array([-1.0]), u=np.array([math.nan]))


@pytest.mark.parametrize(("form", "scalar"), [*((form, "float") for form in FORMS), ("full-joseph", "double")])
def test_covariances_that_are_none(form, scalar):
    for name, kf in library("exact", form, scalar).items():
        calls = Calls(kf)
        n = len(kf.states)
        bad = [-np.eye(n), np.diag([*[1.0] * (n - 1), -1e-3])]
        if n > 1:
            close = np.eye(n)
            close[0, n - 1] = 1.01
            alone = np.zeros((n, n))
            alone[0, 0], alone[0, n - 1] = 1.0, 0.5  # covariance with a state that has no variance
            bad += [close, alone]
        for P in bad:
            refused(calls, Status.NOT_POSITIVE, "set_covariance", P=P.ravel())
        wrong = bad[0].copy()
        wrong[0, n - 1] = math.nan
        refused(calls, Status.NOT_FINITE, "set_covariance", P=wrong.ravel())
        assert kf.set_covariance(np.zeros((n, n))) == 0, name
        assert not kf.P.any()
        assert kf.set_covariance(np.ones((n, n))) == 0  # rank one
        np.testing.assert_allclose(kf.P, np.ones((n, n)), rtol=1e-6)


def poke(kf: NativeFilter, field: str, index: int, value: float) -> float:
    array = getattr(kf.struct.data, field)
    old = float(array[index])
    array[index] = value
    return old


@pytest.mark.parametrize("form", FORMS)
def test_spoiled_filters(form):
    """NaN and infinity written into the struct: refused without a change, or without a trace in the state."""
    for group in ("exact", "libm"):
        for name, kf in library(group, form, "float").items():
            calls = Calls(kf)
            for function in calls.names[:-2]:
                calls(function)
            good = kf.copy()
            for field in [f for f in ("x", "U", "D", "P") if f in kf.struct.fields]:
                for index in range(len(getattr(kf.struct.data, field))):
                    for bad in (math.nan, -math.inf):
                        for function in calls.names[:-2]:
                            kf.struct.ffi.memmove(kf.struct.data, good.struct.data, len(bytes(good)))
                            poke(kf, field, index, bad)
                            before, x = bytes(kf), kf.x
                            status = calls(function)
                            place = f"{name}: {field}[{index}] = {bad}, {function}: {status:#x}"
                            if status >= ERROR or status & Status.GATED:
                                assert status in ERRORS or status == Status.GATED, place
                                assert status == Status.GATED or bytes(kf) == before, place
                            else:
                                assert np.isfinite(kf.x[np.isfinite(x)]).all(), place


@pytest.mark.parametrize(("form", "scalar"), [*((form, "float") for form in FORMS), ("ud-bierman", "double")])
def test_an_indefinite_covariance_is_not_positive(form, scalar):
    kf = library("exact", form, scalar)["cv4"]
    calls = Calls(kf)
    field = "P" if form.startswith("full") else "D"
    for index in range(len(kf.raw[field])):
        poke(kf, field, index, -1e6)
    refused(calls, Status.NOT_POSITIVE, "update_gnss")


@pytest.mark.parametrize("form", FORMS)
def test_a_gated_update_leaves_all_but_nis(form):
    for scalar in SCALARS if form in ("ud-bierman", "full-joseph") else ("float",):
        filters = library("exact", form, scalar)
        for name, sensor in (("switches", "range"), ("run_time", "place"), ("semidefinite", "norm")):
            kf = filters[name]
            calls = Calls(kf)
            for function in calls.names[:-2]:
                calls(function)
            before = kf.copy()
            m = len(kf.components(sensor))
            assert calls(f"update_{sensor}", z=np.full(m, 1e3)) == Status.GATED
            assert kf.nis > 100
            kf.struct.data.nis = before.struct.data.nis
            assert bytes(kf) == bytes(before)


BLOW_UPS = {
    "reciprocal": ("1/x", "x", 0.0),
    "log_of_negative": ("log(x)", "x", -1.0),
    "log_of_zero": ("log(x)", "x", 0.0),
    "exp_overflow": ("exp(x)", "x", 1000.0),
    "root_of_negative": ("sqrt(x)", "x", -1.0),
    "power": ("x**(-2)", "x", 0.0),
    "root_slope": ("x + x**0.25", "x", 0.0),
    "asin": ("asin(x)", "x", 2.0),
    "product": ("x*x*x*x*x*x*x*x", "x", 1e30),
}


def one_state(name: str, f: str, h: str, gate: str = "", extra: str = "") -> str:
    return f"""
kfgen: 1
name: {name}
dt: 0.1
parameters: {{q: 1, r: 1}}
states:
  x: {{init: 1, var: 0.5}}
  y: {{init: 1, var: 0.5}}
inputs: {{w: {{}}}}
dynamics: {{form: discrete, f: {{x: "{f}", y: y + 0.1*x}}, Q: {{x: q}}}}
measurements:
  s:
    z: {{a: {{h: y, std: 1}}, z: {{h: "{h}", var: r}}}}
{gate}
filter: {{type: ekf{extra}}}
"""


GATE = "    gate: {probability: 0.99}"


@pytest.mark.parametrize("form", ["ud-bierman", "full-joseph"])
def test_models_that_blow_up(form):
    """f or h that is not finite at the state: NOT_FINITE, with and without a gate."""
    for scalar in SCALARS if form == "ud-bierman" else ("float",):
        pairs = []
        for name, (expression, other, _) in BLOW_UPS.items():
            for kind, text in (
                ("f", one_state(f"f_{name}", expression, other)),
                ("h", one_state(f"h_{name}", other, expression)),
                ("g", one_state(f"g_{name}", other, expression, GATE)),
            ):
                spec = override(loads(text), scalar, filter=FORMS[form])
                pairs.append((f"{kind}_{name}", name, spec))
        filters = load_filters([build(spec) for _, _, spec in pairs], flags=["-O0"])
        for (label, name, _), kf in zip(pairs, filters, strict=True):
            value = BLOW_UPS[name][2]
            if name == "product":
                value = 1e30 if scalar == "float" else 1e100
            assert kf.set_state([value, 1]) == 0
            before = bytes(kf)
            status = kf.predict([0]) if label.startswith("f") else kf.update("s", [1, 1])
            assert status == Status.NOT_FINITE, f"{label} {scalar}: {status:#x}"
            assert bytes(kf) == before


@pytest.mark.parametrize("form", FORMS)
def test_the_first_error_wins(form):
    """NOT_FINITE stands before NOT_POSITIVE, whichever a variance or a value shows."""
    text = one_state("first", "exp(x)", "y + x/2").replace("Q: {x: q}", "Q: {x: q, y: q}")
    spec = override(loads(text), "float", filter=FORMS[form])
    kf = load_filters([build(spec)])[0]
    for name in ("q", "r"):
        kf.init()
        kf.parameters[name] = -1e6
        before = bytes(kf)
        function = (lambda: kf.predict([0])) if name == "q" else (lambda: kf.update("s", [0, 0]))
        assert function() == Status.NOT_POSITIVE
        if name == "r":
            assert kf.update("s", [0, math.nan]) == Status.NOT_FINITE
        assert bytes(kf) == before
        kf.set_state([1000, 1])
        if name == "q":
            assert kf.predict([0]) == Status.NOT_FINITE


@pytest.mark.parametrize("form", FORMS)
def test_limits_hide_nothing(form):
    """An infinite state is not brought back by its bounds, an infinite variance not by its ceiling."""
    bounded = one_state("bounded", "x + exp(w)", "x").replace("x: {init: 1, var", "x: {init: 1, bounds: [0, 2], var")
    capped = one_state("capped", "0.5*x + y", "x", extra=", variance_ceiling: 100, variance_floor: 1e-6")
    specs = [override(loads(text), "float", filter=FORMS[form]) for text in (bounded, capped)]
    kf, ceiling = load_filters([build(spec) for spec in specs])
    wrong = []
    before = bytes(kf)
    if (status := kf.predict([1000])) != Status.NOT_FINITE or bytes(kf) != before:
        wrong.append(f"bounds: {status:#x}")
    for q in (math.inf, math.nan):
        ceiling.init()
        ceiling.parameters["q"] = q
        before = bytes(ceiling)
        if (status := ceiling.predict([0])) != Status.NOT_FINITE or bytes(ceiling) != before:
            wrong.append(f"ceiling, q = {q}: {status:#x}, {ceiling.raw}")
    assert not wrong


def test_every_group_is_known():
    assert {name for group in GROUPS.values() for name in group} == set(ALL)
    assert "cv4" in EXACT
