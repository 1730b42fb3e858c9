"""Banks: after an error in any mode, and after a gated update, every byte is what it was; the first of the error bits
is returned, as the reference does.

A failure here is the algorithm's: a guard is missing, stands behind a store, or before one that counts more.
"""

from __future__ import annotations

import itertools
import math
import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from banks import DYNAMICS, OPEN, TOP
from calling import Calls, refused

from kfgen.native import NativeFilter, compile_many
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR, Status, describe
from tests.oracle.imm_banks import bank

BAD = (math.nan, math.inf, -math.inf)
GATE = ", gate: {probability: 0.95}"

# every mode can be broken by parameters of its own, at each stage of predict and update
BREAKABLE = "kfgen: 1\nname: breakable\ndt: 0.1\nstates: {x: {init: 1, var: 0.5}, y: {init: 0.2, var: 0.3}}\n"
GOOD = {"q": 0.1, "a": 1.0, "r": 0.2, "l": 5.0, "w": 0.1, "k": 1.0}
WRONG = {
    "q": (-1.0, *BAD[:2]), "a": (0.0, math.nan), "r": (-1.0, -1e-3, math.nan), "l": (-9.0, math.nan),
    "w": (-1.0, -0.01, math.inf), "k": BAD[:2],
}  # fmt: skip
FILTERS = [
    ("", ["type: ekf, robust: chernodarov, adaptive: true", "type: ukf, adapt_R: 0.1", "type: iekf"]),
    (GATE, ["type: ekf, covariance: sqrt", "type: ukf, covariance: full, adaptive: true", "type: ekf2"]),
    (GATE, ["type: ukf, sequential: true, robust: huber", "type: ekf, covariance: full, adapt_R: 0.1, adapt_Q: 0.1",
            "type: ukf, covariance: sqrt"]),
]  # fmt: skip


IN_LOOPS = ["type: ekf", "type: iekf, variance_ceiling: 9", "type: ekf, adaptive: true"]


def breakable(gate: str, filters: list[str]) -> str:
    names = ", ".join(f"{name}{i}: {value}" for i in range(3) for name, value in GOOD.items())
    modes = {}
    for i, options in enumerate(filters):
        learns = "adapt" in options and "adaptive" not in options  # of what is constant
        q, r = ("0.1", "0.2") if learns else (f"q{i}", f"r{i}")
        modes[f"m{i}"] = f"""
noise: {{n: {{var: w{i}}}}}
dynamics: {{f: {{x: 0.9*x + dt*y/a{i}, y: 0.8*y + 0.1*sin(x)*n}}, Q: {{x: {q}, y: 0.01}}}}
measurements:
  s: {{z: {{z: {{h: x + y**2/9 + log(l{i} + x)}}, v: {{h: y + x/9}}}}, R: [[{r}, 0.01], [0.01, 0.3]]{gate}}}
  o: {{z: {{z: {{h: y*k{i} + x/5, std: 0.4}}}}}}
filter: {{{options}}}"""
    return bank(f"{BREAKABLE}parameters: {{{names}}}\n", modes, [[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])


CALLS: list[tuple[str, Any]] = [("predict", ()), ("update", ("s", [3.0, 0.3])), ("update", ("s", [90.0, 3.0])),
                                ("update", ("o", [0.1]))]  # fmt: skip


def test_an_error_in_any_mode_at_any_stage():
    specs = [loads(breakable(*each)) for each in FILTERS]
    specs.append(loads(breakable(GATE, IN_LOOPS).replace("kfgen: 1", "kfgen: 1\ncode: {unroll: none}")))
    met = set()
    for spec, kf in zip(specs, compile_many(specs, "double", flags=["-O0"]), strict=True):
        ref, random = reference(spec), np.random.default_rng(0)
        for each in (kf, ref):
            assert each.predict() == each.update("o", [0.1]) == 0
        good, kept = bytes(kf), pickle.dumps(ref._estimate)
        every = list(kf.parameters)
        for _ in range(40):
            some = random.choice(every, int(random.integers(1, 4)), replace=False)
            changes = {str(name): float(random.choice(WRONG[name[0]])) for name in some}
            for name, arguments in CALLS:
                for each in (kf, ref):
                    each.parameters.update(changes)
                before = bytes(kf)
                ours, theirs = (getattr(each, name)(*arguments) for each in (kf, ref))
                place = f"{kf}: {name}{arguments} with {changes}"
                assert ours == theirs, f"{place}: {describe(ours)}, reference {describe(theirs)}"
                if ours >= ERROR:
                    assert bytes(kf) == before, place
                met.add(ours)
                kf.struct.ffi.memmove(kf.struct.data, good, len(good))
                ref._estimate = pickle.loads(kept)
                ref.parameters.update({each: GOOD[each[0]] for each in every})
    assert {Status.OK, Status.GATED, Status.NOT_FINITE, Status.NOT_POSITIVE} <= met


MIXED = [
    "type: ekf, covariance: sqrt",
    "type: ukf",
    "type: ekf2, adapt_R: 0.05",
    "type: ukf, covariance: full, adaptive: {chi2: 1}",
]


@cache
def _filters() -> list[NativeFilter]:
    code = "code: {log_likelihood: true, gate_count: true}\n"
    every = {f"m{k}": f"{DYNAMICS[k]}\nfilter: {{{each}}}" for k, each in enumerate(MIXED)}
    texts = [
        bank(TOP + code, every, np.full((4, 4), 0.25).tolist()),
        bank(
            TOP.replace("dt: {nominal: 0.1, min: 0.05, max: 0.15}", "dt: {nominal: 0.1}") + code,
            {"a": every["m1"], "b": f"{every['m0']}\n{OPEN}"},
            [[0, 1], [1, 0]], mu0=[1, 0], mu_floor=0,
        ),
        bank(
            TOP + code.replace("code: {", "code: {unroll: none, "),
            {name: every[name].replace(each, MIXED[0]) for name, each in zip(("m0", "m1"), MIXED, strict=False)},
            [[0.5, 0.5], [0.5, 0.5]],
        ),
    ]  # fmt: skip
    return compile_many([loads(text) for text in texts], "float", flags=["-O0"])


def moved() -> Iterator[tuple[NativeFilter, NativeFilter, Calls]]:
    """Banks that have made a few steps, and copies to return to."""
    for kf in _filters():
        kf.init()
        calls = Calls(kf)
        for name in ("predict", *calls.updates, "predict"):
            assert calls(name) < ERROR
        yield kf, kf.copy(), calls


def put_back(kf: NativeFilter, good: NativeFilter) -> None:
    kf.struct.ffi.memmove(kf.struct.data, good.struct.data, len(bytes(good)))


def test_wrong_arguments():
    for kf, _, calls in moved():
        n = len(kf.states)
        for name in calls.names:
            refused(calls, Status.NULL_ARGUMENT, name, kf=None)
            for key, good in calls.vectors[name].items():
                if key == "mask":
                    continue
                if key != "dt":
                    refused(calls, Status.NULL_ARGUMENT, name, **{key: None})
                for i, bad in itertools.product(range(len(good)), BAD):
                    if not calls.leaves(name, key, i):
                        wrong = good.copy()
                        wrong[i] = bad
                        refused(calls, Status.NOT_FINITE, name, **{key: wrong})
        refused(calls, Status.NOT_POSITIVE, "set_covariance", P=-np.eye(n).ravel())
        if kf is _filters()[1]:
            refused(calls, Status.NOT_POSITIVE, "predict", dt=np.array([0.0]))


def test_spoiled_modes():
    """NaN and infinity in a mode's block or in mu: refused without a change, or without a trace in x and mu."""
    for kf, good, calls in moved():
        places = [("mu", i) for i in range(len(kf.mu))]
        places += [
            (f"modes.{mode.name}.{field}", i)
            for mode in kf.modes for field, value in mode.raw.items() if field in ("x", "U", "D", "P", "S")
            for i in range(len(value))
        ]  # fmt: skip
        for (path, i), bad, name in itertools.product(places, BAD, ("predict", *calls.updates)):
            put_back(kf, good)
            owner = kf.struct.data
            *outer, field = path.split(".")
            for part in outer:
                owner = getattr(owner, part)
            getattr(owner, field)[i] = bad
            before, status = bytes(kf), calls(name)
            place = f"{kf}: {path}[{i}] = {bad}, {name}: {describe(status)}"
            if status >= ERROR:
                assert bytes(kf) == before, place
            elif status != Status.GATED:
                assert np.isfinite(kf.x).all(), place
                assert np.isfinite(kf.mu).all(), place


def test_what_is_far_too_large():
    """Readings up to the end of a float's range: refused, gated, or all that is kept is finite."""
    met = set()
    for kf, good, calls in moved():
        for name, size in itertools.product(calls.updates, 10.0 ** np.arange(2, 39, 4)):
            put_back(kf, good)
            before = bytes(kf)
            status = calls(name, z=size * np.ones(len(calls.vectors[name]["z"])))
            met.add(Status(status))
            if status >= ERROR:
                assert bytes(kf) == before
            elif status != Status.GATED:
                fields = [kf.mu, kf.x, *(v for mode in kf.modes for v in mode.raw.values())]
                assert all(np.isfinite(v).all() for v in fields), (kf, name, size)
    assert {Status.OK, Status.NOT_FINITE, Status.GATED} <= met


def test_a_gated_update():
    """Only nis and the count have changed, whatever the modes would flag."""
    gated = set()
    for kf, good, calls in moved():
        for (name, sensor), size in itertools.product(calls.updates.items(), (90.0, 3.0, 1.0, -1.0)):
            put_back(kf, good)
            if calls(name, z=np.full(len(calls.vectors[name]["z"]), size)) != Status.GATED:
                continue
            gated.add((kf, name))
            count = f"gate_count_{sensor}"
            assert getattr(kf.struct.data, count) == getattr(good.struct.data, count) + 1
            assert kf.nis != good.nis
            kf.struct.data.nis = good.struct.data.nis
            setattr(kf.struct.data, count, getattr(good.struct.data, count))
            assert bytes(kf) == bytes(good)
    assert len(gated) == 4  # one mode of the second bank takes every place


GATES = """
kfgen: 1
name: gates
scalar: double
states: {x: {init: 0, var: 1}}
dynamics: {f: {x: x}}
filter: {type: ekf}
code: {gate_count: true}
measurements: {s: {z: {z: {h: x, var: 1}}, gate: {probability: 0.99, reset_after: 2}}}
"""


def test_gates_of_the_modes_own():
    """Of several thresholds and resets the most willing counts; a mode without a gate takes everything."""
    sensor = "measurements: {s: {z: {z: {h: x, var: 1}}GATE}}"
    own = ["", *(sensor.replace("GATE", f", gate: {{{each}}}") for each in (
        "probability: 0.999", "probability: 0.9, reset_after: 5", "probability: 0.99, reset_after: 1",
    )), sensor.replace("GATE", "")]  # fmt: skip
    specs = []
    for k, (low, high) in enumerate(itertools.combinations_with_replacement(own, 2)):
        modes = {
            "low": f"states: {{x: {{init: 0, var: 1}}}}\n{low}",
            "high": f"states: {{x: {{init: 6, var: 1}}}}\nfilter: {{type: ukf}}\n{high}",
        }
        specs.append(replace(loads(bank(GATES, modes, [[0.9, 0.1], [0.1, 0.9]])), name=f"gates_{k}"))
    seen = set()
    for spec, kf in zip(specs, compile_many(specs, flags=["-O0"]), strict=True):
        ref = reference(spec)
        for z in (-3.8, -3.8, -3.8, 11.0, 10.5, 9.0, -9.0, -20.0, -20.0, -20.0, -20.0):
            ours, theirs = kf.update("s", [z]), ref.update("s", [z])
            assert ours == theirs, (spec.name, z)
            assert kf.nis == pytest.approx(ref.nis, rel=1e-12)
            np.testing.assert_allclose(kf.x, ref.x, rtol=1e-12)
            np.testing.assert_allclose(kf.mu, ref.mu, atol=1e-12)
            if any(field.startswith("gate_count_") for field in kf.struct.fields):
                assert kf.gate_count == ref.gate_count
            seen.add(ours)
    assert seen == {Status.OK, Status.GATED, Status.ANOMALY}


def test_copies_are_independent():
    for kf, good, calls in moved():
        other = kf.copy()
        assert calls("predict") < ERROR
        assert bytes(other) == bytes(good) != bytes(kf)
        put_back(kf, good)
        assert calls("set_state") == 0
        assert all((mode.x == kf.x).all() for mode in kf.modes)
        np.testing.assert_array_equal(kf.mu, good.mu)
        P = np.diag(np.arange(1.0, len(kf.states) + 1)) + 0.25
        assert kf.set_covariance(P) == 0
        np.testing.assert_allclose(kf.P, P, rtol=1e-6)
        np.testing.assert_array_equal(kf.mu, good.mu)
