"""Quaternions: what first measurements set of them, and outputs of them, against the reference."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import ERROR, Status

TEXT = """
kfgen: 1
name: turn
scalar: SCALAR
dt: 0.05
constants: {down: [0, 0, 1], north: [22, 0, 42]}
states:
  q: {kind: quaternion, init: [1, 0, 0, 0], std: [0.4, 0.4, 0.8], error: SIDE}
  b: {vector: 3, init: 0, std: 0.05}
covariances: [[q_rx, b_x, 0.01], [q_rz, b_y, -0.02]]
inputs: {gyro: {vector: 3, range: [-3, 3]}}
noise: {w: {vector: 3, root_density: 0.01}}
dynamics: {form: continuous, f: {q: gyro - b - w}, Q: {b: 1e-9}}
measurements:
  imu: {z: {acc: {h: "unrotate(q, down)", std: 0.05}, mag: {h: "unrotate(q, north)", std: 0.5}}}
  star: {z: {s: {h: q, std: [0.01, 0.01, 0.03]}}}
initialize: START
outputs: {heading: {value: yaw(q), unit: rad}, tilt: {value: "norm(cross(rotate(q, down), down)) + b.x"}}
filter: {FILTER}
"""
STARTS = {
    "triad": '{from: imu, states: {q: "triad(acc, mag, down, north)"}, var: {q: [0.01, 0.01, 0.04]}}',
    "measured": "{from: star, states: {q: s}, var: {q: 0.001, b: 1e-4}}",
    "several": '[{from: star, states: {q: "s*from_rotation_vector([0.1, 0, 0])"}, var: {q: 0.01}},'
               ' {from: imu, states: {b: "acc*0.001"}, var: {b: 1e-6}}]',
}  # fmt: skip
BANK = """imm:
  modes: {calm: {}, wild: {noise: {w: {vector: 3, root_density: 0.1}}}}
  transition: [[0.95, 0.05], [0.05, 0.95]]
  mu0: [0.5, 0.5]
"""
FILTERS = {"ud": ("type: ekf", ""), "full": ("type: ekf, covariance: full", ""),
           "ukf": ("type: ukf", ""),
           "sqrt": ("type: ekf, covariance: sqrt", ""), "iekf": ("type: iekf", ""),
           "imm": ("type: ekf", BANK)}  # fmt: skip
CASES = [*(("ud", start, "body") for start in STARTS), ("ud", "measured", "reference"), ("full", "several", "body"),
         ("sqrt", "measured", "body"), ("sqrt", "triad", "reference"), ("iekf", "measured", "body"),
         ("ukf", "several", "body"), ("imm", "triad", "body")]  # fmt: skip


def text_of(shape: str, start: str, side: str = "body", scalar: str = "double") -> str:
    chosen, more = FILTERS[shape]
    text = TEXT.replace("START", STARTS[start]).replace("FILTER", chosen).replace("SIDE", side)
    return text.replace("SCALAR", scalar) + more


@cache
def _filters() -> dict[tuple[str, str, str], NativeFilter]:
    texts = {case: text_of(*case).replace("name: turn", f"name: turn_{i}") for i, case in enumerate(CASES)}
    return dict(zip(texts, load_filters([build(loads(text)) for text in texts.values()]), strict=True))


@pytest.mark.parametrize("case", CASES, ids=" ".join)
def test_agrees_with_the_reference(case: tuple[str, str, str]) -> None:
    kf = _filters()[case].copy()
    kf.init()
    ref = reference(kf.spec)
    log = simulate(kf.spec, 30, every={"star": 4})
    result, wanted = kf.run(log), ref.run(log.columns)
    np.testing.assert_allclose(result.x, wanted.x, atol=1e-9)
    np.testing.assert_allclose(result.var, wanted.var, rtol=1e-7, atol=1e-13)
    for name in ("heading", "tilt"):
        np.testing.assert_allclose(result.outputs[name], wanted.outputs[name], atol=1e-9)
        np.testing.assert_allclose(result.output_std[name], wanted.output_std[name], rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("shape", ["ud", "sqrt"])
def test_a_quaternion_of_any_length_but_none(shape: str) -> None:
    kf = _filters()[shape, "measured", "body"].copy()
    kf.init()
    for each in (kf, reference(kf.spec)):
        before = each.x
        assert each.update("star", [0.0, 0.0, 0.0, 1e-5]) == Status.NOT_POSITIVE
        assert each.update("star", [np.nan, 0.0, 0.0, 1.0]) == Status.NOT_FINITE
        np.testing.assert_array_equal(each.x, before)
        assert each.update("star", [3e200, 0.0, 4e200, 0.0]) == Status.OK
        np.testing.assert_allclose(each.x[:4], [0.6, 0.0, 0.8, 0.0], atol=1e-15)
        np.testing.assert_allclose(np.diag(each.P), [0.001] * 3 + [1e-4] * 3, rtol=1e-12)
        assert np.count_nonzero(each.P - np.diag(np.diag(each.P))) == 0


def test_parallel_directions_do_no_harm() -> None:
    """Of two readings along one line triad has to make what it can, or refuse."""
    kf = _filters()["ud", "triad", "body"].copy()
    kf.init()
    for each in (kf, reference(kf.spec)):
        each.init()
        status = each.update("imu", [0.0, 0.0, 1.0, 0.0, 0.0, 47.0])
        assert status < ERROR or status in (Status.NOT_POSITIVE, Status.NOT_FINITE)
        assert np.isfinite(each.x).all()
        assert np.linalg.norm(each.x[:4]) == pytest.approx(1.0)


@pytest.mark.parametrize("start", STARTS)
def test_in_float(start: str) -> None:
    (kf,) = load_filters([build(loads(text_of("ud", start, scalar="float")))])
    ref = reference(kf.spec)
    log = simulate(kf.spec, 30, every={"star": 4})
    result, wanted = kf.run(log), ref.run(log.columns)
    assert np.abs(result.x - wanted.x).max() < 2e-4
    assert np.abs(result.var / wanted.var - 1).max() < 2e-3
