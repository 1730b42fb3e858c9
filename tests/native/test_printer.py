"""The program, run in Python, against the compiled C: bit for bit. A failure here is the printer's.

What the C computes is defined by the scheduled program and the rules of IEEE 754, with neither contraction nor
excess precision. Whether the program is the right one is asked elsewhere.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from emitted import ALL, CHAIN16, EXACT, FLAGS, FORMS, LARGE, LIBM, compiled, generated, spec_of
from twin import Twin, compiled_call

from kfgen.native import load_filters
from kfgen.native.run import Plan, plan
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import Status

# float: long enough to meet gates, limits and turns of angles; double differs in spelling only
STEPS = {"float": 60, "double": 20}
STEPS_OF = {"chain16": 3, "att": 12, "chain8": 20}  # the large ones repeat the same few patterns


def cases(names: Iterable[str], double: Iterable[str]) -> list[Any]:
    """Every form in float; in double the forms that are given."""
    pairs = [(form, "float") for form in FORMS] + [(form, "double") for form in double]
    return [pytest.param(n, form, scalar, id=f"{n}-{form}-{scalar}") for form, scalar in pairs for n in names]


@cache
def track(name: str, steps: int) -> Plan:
    """A plausible log: the model's own track, each sensor at its own rate; the same for all forms."""
    spec = loads(ALL[name])
    every = {sensor.name: 1 + i % 2 for i, sensor in enumerate(spec.measurements)}
    return plan(spec, simulate(spec, steps, 7, every, 0.1))


def calls(name: str, steps: int) -> list[tuple[str, dict[str, Any]]]:
    """The calls of a track, with outliers, steps beyond their limits, and a few that must be refused."""
    spec, work = loads(ALL[name]), track(name, steps)
    random = np.random.default_rng(3)
    run_time = spec.dt is not None and spec.dt.run_time
    out: list[tuple[str, dict[str, Any]]] = []
    for row in range(steps):
        keywords: dict[str, Any] = {}
        if spec.inputs:
            keywords["u"] = work.u[row] + random.normal(0, 0.5, len(spec.inputs))
        if run_time:
            keywords["dt"] = work.dt[row] * random.choice([1, 1, 1, 1, 0.5, 2, 0.001, 10])
        out.append(("predict", keywords))
        first = 0
        for i, sensor in enumerate(spec.measurements):
            z = work.z[row, first : first + len(sensor.components)].copy()
            first += len(z)
            if not work.mask[row, i]:
                continue
            if random.random() < 0.05:
                z *= random.choice([-5, 8])
            if random.random() < 0.02:
                z[random.integers(len(z))] = random.choice([np.nan, np.inf, 1e300])
            out.append((f"update_{sensor.name}", {"z": z, **{k: v for k, v in keywords.items() if k == "u"}}))
    return out


def twin_of(name: str, form: str, scalar: str) -> Twin:
    return Twin(generated(name, form, scalar), compiled(name, form, scalar))


def follow(name: str, twin: Twin, steps: int) -> set[int]:
    """Run both over a track and compare after every call; returns the statuses met."""
    met = set()
    for count, (function, keywords) in enumerate(calls(name, steps)):
        ours, theirs = twin.run(function, **keywords), compiled_call(twin.kf, function, keywords)
        assert ours == theirs, f"call {count}, {function}: program {ours:#x}, C {theirs:#x}"
        assert not twin.differences(), f"call {count}, {function}"
        met.add(theirs)
    return met


@pytest.mark.parametrize(
    ("name", "form", "scalar"), cases(EXACT, ["ud-bierman"]) + cases(LARGE, []) + cases(CHAIN16, [])
)
def test_c_is_the_program(name, form, scalar):
    met = follow(name, twin_of(name, form, scalar), STEPS_OF.get(name, STEPS[scalar]))
    assert Status.OK in met or name == "confined"
    if scalar == "double":
        return
    if name in ("switches", "run_time"):
        assert any(status & Status.GATED for status in met)
    if name == "run_time":
        assert any(status & Status.DT_CLAMPED for status in met)
    if name == "confined":
        assert any(status & Status.REGULARIZED for status in met)
    if name in ("switches", "cv4", "ball"):
        assert Status.NOT_FINITE in met


@pytest.mark.parametrize(("name", "form", "scalar"), cases(LIBM, ["ud-bierman"]))
def test_c_is_the_program_but_for_libm(name, form, scalar):
    """Each call from the same bits: what differs is the last place of sin, exp and the like, and what follows."""
    twin = twin_of(name, form, scalar)
    worst = 0.0
    for function, keywords in calls(name, 40):
        ours, theirs = twin.run(function, **keywords), compiled_call(twin.kf, function, keywords)
        assert ours == theirs
        worst = max(worst, twin.errors())
        twin.copy_fields()
    assert worst < 64


@pytest.mark.skipif(shutil.which("clang") is None, reason="no clang")
@pytest.mark.parametrize("form", ["ud-bierman"])
def test_clang_gives_the_same_bits(form, monkeypatch):
    monkeypatch.setenv("CC", "clang")
    for name in ("switches", "run_time", "semidefinite"):
        made = generated(name, form, "float")
        follow(name, Twin(made, load_filters([made], flags=FLAGS["exact"])[0]), 40)


@pytest.mark.parametrize(
    ("name", "form", "scalar"),
    cases(["switches", "semidefinite", "six_sensors"], ["ud-bierman"]) + cases(["chain8"], []),
)
def test_loops(name, form, scalar):
    """init, set_state, set_covariance and get_covariance, in which indices are computed."""
    twin = twin_of(name, form, scalar)
    kf, n = twin.kf, len(twin.kf.states)
    random = np.random.default_rng(5)
    for trial in range(14):
        rank = int(random.integers(1, n + 1))
        A = np.round(random.normal(size=(n, rank)), 1) * 10.0 ** random.integers(-2, 3, (n, 1))
        P = A @ A.T
        if trial % 4 == 1:
            i = random.integers(n)
            P[i, i] -= 0.5 * P[i, i] + 1e-3
        if trial % 7 == 6:
            P[0, -1] = random.choice([np.nan, np.inf])
        for function, keywords in (
            ("set_covariance", {"P": P}),
            ("set_state", {"x": random.normal(0, 10, n) if trial % 5 else np.full(n, np.nan)}),
        ):
            assert twin.run(function, **keywords) == compiled_call(kf, function, keywords)
            assert not twin.differences(), function
        twin.memory.arrays["P"] = [None] * (n * n)
        assert twin.run("get_covariance") == 0
        assert np.array(twin.memory.arrays["P"], dtype=np.float64).reshape(n, n).tobytes() == kf.P.tobytes()
    assert twin.run("init") == kf.init() == 0
    assert not twin.differences()


def test_initial_values_are_the_specs():
    """They are rounded once, from the exact value of the spec."""
    spec = spec_of("chain8", "full-joseph", "float")
    kf = compiled("chain8", "full-joseph", "float")
    assert kf.x.tolist() == [float(np.float32(0.1))] * 4 + [0.0] * 4
    np.testing.assert_array_equal(kf.P, np.eye(8))
    assert generated("chain8", "full-joseph", "float").code.model.dt == Fraction(1, 20)
    assert len(spec.states) == 8
