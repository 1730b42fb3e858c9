"""Corners of rotations in C: gates beside resets, masks, noises that a quaternion multiplies."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import Status
from tests.oracle.error_state import Space, upper

TEXT = """
kfgen: 1
name: NAME
scalar: double
dt: 0.05
constants: {down: [0, 0, 1]}
states:
  q: {kind: quaternion, init: [0.9, 0.1, -0.3, 0.2], std: [0.2, 0.3, 0.4], error: SIDE}
  b: {vector: 3, init: 0, std: 0.1}
covariances: [[q_rx, b_x, 0.005]]
inputs: {gyro: {vector: 3, range: [-3, 3]}}
"""
GATED = """
dynamics: {form: continuous, f: {q: gyro - b}, Q: {b: 1e-6, q: 1e-4}}
measurements: {acc: {z: {a: {h: "unrotate(q, down)", std: 0.1}}, gate: {probability: 0.9, reset_after: 2}}}
"""
POSE = """
dynamics: {form: continuous, f: {q: gyro - b}, Q: {b: 1e-6, q: 1e-4}}
measurements: {pose: {partial: true, z: {q: {h: q, std: [0.1, 0.1, 0.3]}, n: {h: b, std: 0.1}}}}
"""
BENT = """
noise: {w: {std: 0.1}, v: {vector: 3, std: 0.05}}
dynamics: {form: continuous, f: {q: gyro - b - v, b: "[q.x*w, 0, -b.z]"}, Q: {b: 1e-6, q: 1e-4}}
measurements: {star: {z: {q: {h: q, std: [0.1, 0.1, 0.3]}}}}
"""
STILL = """
noise: {wb: {vector: 3, root_density: 0.01}}
dynamics: {form: continuous, integrator: exact, f: {b: wb - 0.1*b}, Q: {q: 1e-4}}
measurements: {star: {z: {q: {h: q, std: [0.1, 0.1, 0.3]}}}}
"""
CASES = {
    f"gate {kind}": (GATED, kind) for kind in ("ekf", "ekf, covariance: full", "ekf, covariance: sqrt", "iekf", "ukf")
} | {f"mask {kind}": (POSE, kind) for kind in ("ekf", "iekf", "ukf", "ukf, sequential: true")} | {
    # a part of q times a noise: it is no rotation of the noise
    f"bent {kind}": (BENT, kind) for kind in ("ekf", "ukf", "ukf, covariance: full")
} | {f"still {kind}": (STILL, kind) for kind in ("ekf", "ukf")}  # fmt: skip


def text_of(case: str, side: str, name: str) -> str:
    body, kind = CASES[case]
    text = TEXT + body + f"filter: {{type: {kind}}}\n"
    return text.replace("NAME", name).replace("SIDE", side)


@cache
def _filters() -> dict[tuple[str, str], NativeFilter]:
    keys = [(case, side) for case in CASES for side in ("body", "reference")]
    texts = [text_of(case, side, f"corner_{i}") for i, (case, side) in enumerate(keys)]
    return dict(zip(keys, load_filters([build(loads(text)) for text in texts]), strict=True))


def fresh(case: str, side: str) -> NativeFilter:
    kf = _filters()[case, side].copy()
    kf.init()
    return kf


BOTH = pytest.mark.parametrize("side", ["body", "reference"])


@BOTH
@pytest.mark.parametrize("case", CASES)
def test_agrees_with_the_reference(case: str, side: str) -> None:
    kf = fresh(case, side)
    log = simulate(kf.spec, 40, seed=1)
    result, wanted = kf.run(log), reference(kf.spec).run(log.columns)
    np.testing.assert_allclose(result.x, wanted.x, atol=1e-9)
    np.testing.assert_allclose(result.var, wanted.var, rtol=1e-8)
    np.testing.assert_array_equal(result.status, wanted.status)


@BOTH
@pytest.mark.parametrize("case", [case for case in CASES if case.startswith("gate")])
def test_a_gate_refuses_whatever_the_reset_does(case: str, side: str) -> None:
    kf = fresh(case, side)
    ref = reference(kf.spec)
    for each in (kf, ref):
        x, P = each.x, each.P
        far = [0.0, 0.0, 9.0]
        assert [each.update("acc", far) for _ in range(2)] == [Status.GATED] * 2
        np.testing.assert_array_equal(each.x, x)
        np.testing.assert_array_equal(each.P, P)
        assert each.update("acc", far) == Status.ANOMALY
    np.testing.assert_allclose(kf.x, ref.x, atol=1e-9)


@BOTH
@pytest.mark.parametrize("case", [case for case in CASES if case.startswith("mask")])
def test_a_mask_takes_a_quaternion_as_a_whole_or_not_at_all(case: str, side: str) -> None:
    """Bits 0 to 3 are the quaternion's; what a mask leaves out may be anything."""
    kf = fresh(case, side)
    ref = reference(kf.spec)
    calls = [(0b1110000, [0, 0, 0, 0, 0.1, 0.2, 0.3]), (0b0010000, [0, np.nan, 0, 0, 0.1, np.inf, 0]),
             (0b0001111, [1, 0.1, 0, 0, np.nan, 0, np.nan]), (0b1000111, [0, 0, 0, 0, 0, 0, 0.1]),
             (0, [0] * 7), (0b1111111, [-1, 0.1, 0.2, 0, 0.1, 0.1, 0.2])]  # fmt: skip
    for mask, z in calls:
        assert kf.update("pose", z, mask=mask) == ref.update("pose", z, mask=mask) == Status.OK, bin(mask)
        np.testing.assert_allclose(kf.x, ref.x, atol=1e-9)
        np.testing.assert_allclose(kf.P, ref.P, atol=1e-12)


def test_an_exact_step_turns_nothing() -> None:
    text = text_of("still ekf", "body", "turning").replace("f: {b:", "f: {q: gyro - b, b:")
    with pytest.raises(SpecError, match="the attitude q that turns is none; use rk4"):
        build(loads(text))


@pytest.mark.parametrize("case", ["mask ekf", "gate ekf, covariance: full"])
def test_a_million_steps_of_float(case: str) -> None:
    """|q| stays 1 and P positive while it tumbles, hardly ever measured."""
    steps = 1_000_000
    text = text_of(case, "body", "tumbling").replace("scalar: double", "scalar: float").replace("dt: 0.05", "dt: 0.01")
    (kf,) = load_filters([build(loads(text))])
    random, t = np.random.default_rng(4), np.arange(steps) * 0.01
    columns = {f"gyro_{a}": 3 * np.sin((0.7 + 0.2 * i) * t + i) for i, a in enumerate("xyz")}
    for name in kf.components("pose" if "mask" in case else "acc"):
        column = np.full(steps, np.nan)
        column[::100] = random.standard_normal(steps // 100)
        columns[f"{'pose' if 'mask' in case else 'acc'}.{name}"] = column
    result = kf.run(columns)
    assert not result.counts(errors=True)
    assert np.max(np.abs(np.linalg.norm(result.x[:, :4], axis=1) - 1)) < 1e-6
    assert result.var.min() > 0
    assert np.linalg.eigvalsh(kf.P)[0] > 0


@BOTH
def test_wide_attitudes_come_round(side: str) -> None:
    """Points beyond pi lie where the rotation takes them: by a dense filter of its own."""
    text = text_of("bent ukf", side, "wide").replace("std: [0.2, 0.3, 0.4]", "std: [1, 1, 2]").replace("0.005", "0.02")
    (kf,) = load_filters([build(loads(text))])
    space = Space(7, (0,), side)
    P, x = np.diag([1, 1, 4, 0.01, 0.01, 0.01]), np.array([0.9, 0.1, -0.3, 0.2, 0, 0, 0])
    P[0, 3] = P[3, 0] = 0.02
    x = space.unit(x)
    d = np.sqrt(6) * upper(P).T
    d = np.concatenate([d, -d])
    z = np.array([-2, 0.4, 0, 0.1]) / np.linalg.norm([-2, 0.4, 0, 0.1])
    seen = Space(4, (0,), "body")
    images = [space.plus(x, each)[:4] for each in d]
    e = np.array([seen.minus(image, x[:4]) for image in images])
    mean = e.mean(axis=0)
    T = seen.reset(mean)
    S = T @ (e - mean).T @ (e - mean) @ T.T / 12 + np.diag([0.01, 0.01, 0.09])
    K = (d.T @ (e - mean) / 12) @ T.T @ np.linalg.inv(S)
    dx = K @ seen.minus(z, seen.plus(x[:4], mean))
    wanted = space.reset(dx) @ (P - K @ S @ K.T) @ space.reset(dx).T
    for each in (kf, reference(kf.spec)):
        assert each.update("star", z) == Status.OK
        np.testing.assert_allclose(each.x, space.plus(x, dx), atol=1e-9)
        np.testing.assert_allclose(each.P, wanted, atol=1e-9)
