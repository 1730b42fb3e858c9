"""adapt_Q where dt is given at run time and Q is a constant times dt: kept and learnt per second."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import Status

STEP = 0.2
SPEC = """
kfgen: 1
name: seconds
scalar: double
dt: DT
states: {a: {init: 0, std: 1}, b: {init: 0, std: 1}, c: {init: 0.2, std: 1}}
let: {rate: 0.3*dt}
dynamics: {f: {a: a + dt*b, b: "b + 0.1*dt*sin(c)"}, Q: QQ}
measurements: {m: {z: {z: {h: a + 0.1*b**2, std: 0.1}, y: {h: c, std: 0.4}}, partial: true}}
filter: {TYPE, adapt_Q: 0.05}
code: {unroll: UNROLL}
"""
BANK = SPEC.replace("filter: {TYPE, adapt_Q: 0.05}", """imm:
  modes:
    one: {filter: {type: ekf, covariance: full, adapt_Q: 0.05}}
    two: {filter: {type: ekf, adapt_Q: 0.2}}
  transition: [[0.9, 0.1], [0.1, 0.9]]""")  # fmt: skip
NOISES = ["{a: 0.01*dt, b: rate, c: dt/4}", "[[0.1*dt, 0.02*dt, 0], [0.02*dt, 0.2*dt, 0], [0, 0, 0.01*dt]]"]
TYPES = ["type: ekf", "type: ekf, update: joseph", "type: ekf, covariance: full",
         "type: ekf, covariance: full, update: standard", "type: ekf, covariance: sqrt", "type: ekf2"]  # fmt: skip
RUN_TIME = "{nominal: 0.2, min: 0.01, max: 1}"


def text(kind: str, unroll: str, Q: str, dt: str = RUN_TIME) -> str:
    base = BANK if kind == "imm" else SPEC.replace("TYPE", kind)
    return base.replace("QQ", Q).replace("UNROLL", unroll).replace("DT", dt)


def learnt(kf: Any) -> np.ndarray:
    """Q, of a bank none: what is learnt shows in its covariances."""
    return np.zeros((3, 3)) if kf.spec.imm else np.array(kf.Q)


@pytest.fixture(scope="module")
def filters() -> dict[tuple[str, str, str, str], Any]:
    cases = [(kind, unroll, Q, dt) for kind in [*TYPES, "imm"] for unroll in ("full", "none") for Q in NOISES
             for dt in (RUN_TIME, str(STEP)) if (kind, unroll) != ("imm", "none")]  # fmt: skip
    specs = [replace(loads(text(*case)), name=f"seconds_{i}") for i, case in enumerate(cases)]
    return dict(zip(cases, load_filters([build(spec) for spec in specs], flags=["-O0"]), strict=True))


def test_steps_of_any_length_are_those_of_the_reference(filters) -> None:
    for case, kf in filters.items():
        if case[3] != RUN_TIME:
            continue
        ref, random = reference(kf.spec), np.random.default_rng(2)
        kf.init()
        for k in range(40):
            dt, z = float(random.uniform(0.05, 1.3)), random.normal(size=2)
            clamped = Status.DT_CLAMPED if dt > 1 else 0
            assert kf.predict(dt=dt) == ref.predict(dt=dt) == clamped
            mask = {} if k % 3 else {"mask": 1 + k % 2}
            if k % 5 != 4:
                assert kf.update("m", z, **mask) == ref.update("m", z, **mask) == 0
        for mine, theirs in ((kf.x, ref.x), (kf.P, ref.P), (learnt(kf), learnt(ref))):
            np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-10, err_msg=str(case))


def test_with_equal_steps_it_is_what_is_learnt_per_step(filters) -> None:
    """From the first update on, before which there was no step: the nominal one stands for it."""
    for case, fixed in filters.items():
        if case[3] == RUN_TIME:
            continue
        kf, random = filters[*case[:3], RUN_TIME], np.random.default_rng(3)
        kf.init()
        fixed.init()
        np.testing.assert_allclose(STEP * learnt(kf), learnt(fixed), rtol=1e-12)
        for k in range(30):
            if k:
                assert kf.predict(dt=STEP) == fixed.predict() == 0
            z = random.normal(size=2)
            assert kf.update("m", z) == fixed.update("m", z) == 0
        np.testing.assert_allclose(STEP * learnt(kf), learnt(fixed), rtol=1e-8)
        np.testing.assert_allclose(kf.x, fixed.x, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(kf.P, fixed.P, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("kind", ["type: ekf", "type: ekf, covariance: full"])
def test_in_fixed_point(kind) -> None:
    spec = override(loads(text(kind, "auto", NOISES[1])), "q16.16")
    (kf,), ref, random = load_filters([build(spec)]), reference(spec), np.random.default_rng(1)
    for _ in range(100):
        dt, z = round(random.uniform(0.05, 0.6) * 65536) / 65536, np.round(random.normal(size=2) * 20000) / 65536
        assert kf.predict(dt=dt) == kf.update("m", z) == 0
        ref.predict(dt=dt)
        ref.update("m", z)
    assert np.all(np.abs(kf.x - ref.x) < 0.1 * np.sqrt(ref.P.diagonal()))  # what fixed point promises in its box
    np.testing.assert_allclose(kf.Q, ref.Q, rtol=0.05, atol=1e-4)


@pytest.mark.parametrize(
    ("Q", "says"),
    [
        ("{a: 0.01*dt, b: 0.1}", "dynamics.Q.b: `0.1` is no constant times dt"),
        ("{a: 0.01*dt**2}", "is no constant times dt"),
        ("{a: 0.1*dt + 0.1}", "is no constant times dt"),
        ("{a: sqrt(dt)}", "is no constant times dt"),
        ("{a: t*dt}", "Q varies with t, but"),
        ("{a: b**2*dt}", "Q varies with states, but"),
    ],
)
def test_what_is_no_constant_per_second(Q, says) -> None:
    with pytest.raises(SpecError) as caught:
        loads(text("type: ekf", "auto", Q).replace("let: {rate: 0.3*dt}", ""))
    assert says in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_constant_is_learnt_per_step() -> None:
    spec = loads(text("type: ekf", "auto", "{a: 0.1}").replace("let: {rate: 0.3*dt}", ""))
    assert "step" not in {block.name for block in build(spec).code.blocks}
