"""Known values that come with a measurement: the compiled filter against the reference, and what it refuses."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from kfgen.check import compare
from kfgen.errors import KfgenError
from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import ERROR, Status

TEXT = """
kfgen: 1
name: ranging
scalar: SCALAR
dt: {nominal: 0.1, min: 0.01, max: 1}
parameters: {s0: {value: 0.3, range: [0.1, 1]}}
states:
  px: {init: 10, std: 3, unit: m, range: [-60, 60]}
  py: {init: -5, std: 3, unit: m, range: [-60, 60]}
  vx: {init: 0, std: 1, range: [-10, 10]}
  vy: {init: 0, std: 1, range: [-10, 10]}
inputs: {ax: {range: [-2, 2]}, wind: {range: [-1, 1]}}
noise: {wx: {density: 0.1}, wy: {density: 0.1}}
dynamics: {form: continuous, f: {px: vx, py: vy, vx: ax + wx, vy: wy}}
measurements:
  beacon:
    partial: true
    inputs: {b: {vector: [x, y], unit: m, range: [-80, 80], doc: where it stands}, sigma: {unit: m, range: [0.5, 2]},
             channel: {range: [0, 5]}}
    z: {r: {h: "sqrt((px - b.x)**2 + (py - b.y)**2 + 1)", var: "(sigma + s0)**2", unit: m, range: [0, 300]},
        dv: {h: vx - wind, std: sigma, range: [-11, 11]}}
    gate: {threshold: 20*sigma}
  pos: {z: {x: {h: px, std: 2}, y: {h: py, std: 2}}}
filter: {FILTER}
"""
BANK = """imm:
  modes: {calm: {}, wild: {filter: {type: ukf}}}
  transition: [[0.95, 0.05], [0.05, 0.95]]
  mu0: [0.5, 0.5]
"""
FILTERS = {
    "ekf": "type: ekf", "full": "type: ekf, covariance: full", "sqrt": "type: ekf, covariance: sqrt",
    "standard": "type: ekf, covariance: full, update: standard", "iekf": "type: iekf, iterations: 3",
    "ekf2": "type: ekf2", "ukf": "type: ukf", "ukf full": "type: ukf, covariance: full",
    "sequential": "type: ukf, sequential: true", "options": "type: ekf, adaptive: true, robust: huber, adapt_Q: 0.01",
}  # fmt: skip
SHAPES = {**{name: (chosen, "") for name, chosen in FILTERS.items()}, "imm": ("type: ekf", BANK)}


def text_of(shape: str, scalar: str = "double", code: str = "") -> str:
    chosen, more = SHAPES[shape]
    return TEXT.replace("FILTER", chosen).replace("SCALAR", scalar) + more + code


@cache
def _filters() -> dict[str, NativeFilter]:
    made = {shape: build(loads(text_of(shape).replace("ranging", f"ranging_{i}"))) for i, shape in enumerate(SHAPES)}
    return dict(zip(made, load_filters(list(made.values())), strict=True))


def filter_of(shape: str = "ekf") -> NativeFilter:
    kf = _filters()[shape].copy()
    kf.init()
    return kf


@pytest.mark.parametrize("shape", SHAPES)
def test_agrees_with_the_reference(shape: str) -> None:
    kf = filter_of(shape)
    outcome = compare(kf, reference(kf.spec), 80)
    assert outcome.passed
    assert not outcome.differences
    assert outcome.x.error < 1e-9
    assert outcome.P.error < 1e-9


@pytest.mark.parametrize(("shape", "scalar", "code"), [
    ("ekf", "float", ""), ("ekf", "double", "code: {unroll: none}"), ("ukf", "double", "code: {unroll: none}"),
    ("ekf", "q16.16", ""), ("ukf", "q16.16", ""),
])  # fmt: skip
def test_in_other_scalars_and_in_loops(shape: str, scalar: str, code: str) -> None:
    generated = build(loads(text_of(shape, scalar, code)))
    (kf,) = load_filters([generated])
    assert compare(kf, reference(kf.spec), 80, coarse=reference(kf.spec)).passed
    if scalar == "q16.16":
        for name in ("R", "B_X", "B_Y", "SIGMA", "CHANNEL"):
            assert f"#define RANGING_BEACON_{name}_LSB " in generated.files["ranging.h"]


def test_they_are_fields_behind_the_components() -> None:
    header = build(loads(text_of("ekf"))).files["ranging.h"]
    start = header.index("typedef struct {", header.index("ranging_real_t wind;"))
    body = header[start : header.index("} ranging_beacon_t;")]
    names = [line.split("ranging_real_t ")[1].split(";")[0] for line in body.splitlines() if "real_t" in line]
    assert names == ["r", "dv", "b_x", "b_y", "sigma", "channel"]
    assert "/* [m] where it stands */" in body
    assert "#define RANGING_NZ_BEACON 2" in header


@pytest.mark.parametrize("shape", ["ekf", "ukf", "imm"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_read_is_tested_and_no_more(shape: str, bad: float) -> None:
    kf, ref = filter_of(shape), reference(loads(text_of(shape)))
    good = {"b_x": 3.0, "b_y": 4.0, "sigma": 1.0, "channel": 2.0}
    for each in (kf, ref):
        assert each.predict([0.0, 0.0], 0.1) < ERROR
    for name in good:
        before = bytes(kf)
        for each in (kf, ref):
            status = each.update("beacon", [9.0, 0.0], [0.0, 0.0], inputs={**good, name: bad})
            assert (status == Status.NOT_FINITE) == (name != "channel"), name
        assert (bytes(kf) == before) == (name != "channel")
    # under a mask only what the components in use need
    only_dv = {**good, "b_x": bad, "b_y": bad}
    for each in (kf, ref):
        assert each.update("beacon", [bad, 0.0], [0.0, 0.0], mask=0b10, inputs=only_dv) < ERROR
        assert each.update("beacon", [9.0, 0.0], [0.0, 0.0], mask=0b01, inputs=only_dv) == Status.NOT_FINITE
        assert each.update("beacon", [9.0, 0.0], [0.0, bad], mask=0b01, inputs=good) < ERROR
    np.testing.assert_allclose(kf.x, ref.x, atol=1e-9)


@pytest.mark.parametrize("make", [filter_of, lambda: reference(loads(text_of("ekf")))])
def test_arguments_in_python(make: Any) -> None:
    kf, u = make(), [0.0, 0.0]
    with pytest.raises(TypeError, match="inputs"):
        kf.update("beacon", [9.0, 0.0], u)
    with pytest.raises(TypeError, match="pos"):
        kf.update("pos", [9.0, 0.0], inputs=[1.0])
    with pytest.raises(KeyError):
        kf.update("beacon", [9.0, 0.0], u, inputs={"b_x": 1.0, "b_y": 1.0, "sigma": 1.0})
    with pytest.raises(KeyError):
        kf.update("beacon", [9.0, 0.0], u, inputs={"b_x": 1.0, "b_y": 1.0, "sigma": 1.0, "chanel": 1.0})
    with pytest.raises(ValueError):  # noqa: PT011 - numpy's own in the reference
        kf.update("beacon", [9.0, 0.0], u, inputs=[1.0, 2.0])
    assert kf.update("beacon", [9.0, 0.0], u, inputs=[3.0, 4.0, 1.0, 0.0]) < ERROR
    named = make()
    assert named.update("beacon", [9.0, 0.0], u, inputs={"channel": 0.0, "sigma": 1.0, "b_y": 4.0, "b_x": 3.0}) < ERROR
    np.testing.assert_array_equal(kf.x, named.x)


def test_several_rows_of_one_time_are_several_calls() -> None:
    """One sensor, called once for each beacon."""
    beacons = [(30.0, 0.0), (0.0, 30.0), (-30.0, -10.0)]
    kf, ref, log = filter_of(), reference(loads(text_of("ekf"))), {}
    rows = [(0.1 * k, b) for k in range(4) for b in beacons]
    one = filter_of()
    for t, b in rows:
        if t > 0 and b == beacons[0]:
            one.predict([0.0, 0.0], 0.1 * round(10 * t) - 0.1 * (round(10 * t) - 1))
        one.update("beacon", [math.hypot(b[0], b[1]), 0.0], [0.0, 0.0], inputs=[*b, 1.0, 0.0])
    log = {
        "t": [t for t, _ in rows], "ax": [0.0] * len(rows), "wind": [0.0] * len(rows),
        "beacon.r": [math.hypot(*b) for _, b in rows], "beacon.dv": [0.0] * len(rows),
        "beacon.b_x": [b[0] for _, b in rows], "beacon.b_y": [b[1] for _, b in rows],
        "beacon.sigma": [1.0] * len(rows), "beacon.channel": [0.0] * len(rows),
    }  # fmt: skip
    result, wanted = kf.run(log), ref.run(log)
    np.testing.assert_allclose(result.x[-1], one.x, rtol=1e-12)
    np.testing.assert_allclose(result.x, wanted.x, atol=1e-9)
    assert np.isfinite(result.nis["beacon"]).all()


def test_without_them_a_row_is_no_measurement() -> None:
    spec = loads(text_of("ekf"))
    log = dict(simulate(spec, 20).columns)
    log["beacon.sigma"] = np.where(np.arange(20) % 3 == 0, np.nan, log["beacon.sigma"])
    result, wanted = filter_of().run(log), reference(spec).run(log)
    assert np.isnan(result.nis["beacon"][::3]).all()
    assert np.isfinite(result.nis["beacon"][1::3]).all()
    np.testing.assert_allclose(result.x, wanted.x, atol=1e-9)
    del log["beacon.sigma"]
    with pytest.raises(KfgenError, match=r"beacon\.sigma"):
        filter_of().run(log)


def test_simulated_over_their_ranges() -> None:
    log = simulate(loads(text_of("ekf")), 200)
    for name, low, high in (("b_x", -80, 80), ("sigma", 0.5, 2), ("channel", 0, 5)):
        column = log.columns[f"beacon.{name}"]
        assert low <= column.min() < column.max() <= high
    again = simulate(loads(text_of("ekf")), 200)
    np.testing.assert_array_equal(log.columns["beacon.b_x"], again.columns["beacon.b_x"])


def test_with_a_steady_gain() -> None:
    """The gain does not depend on them; the residual does."""
    text = """
kfgen: 1
name: steady
scalar: double
dt: 0.1
inputs: {u: {}}
states: {p: {init: 1, std: 1}, v: {init: 2, std: 1}}
dynamics: {f: {p: p + dt*v, v: v + dt*u}, Q: {v: 0.1}}
measurements: {m: {inputs: {b: {}, idle: {}}, z: {p: {h: p - b, std: 1}}}}
initialize: [{from: m, states: {p: p + b, v: u}}]
filter: {type: kf, gain: steady}
"""
    (kf,) = load_filters([build(loads(text))])
    for each in (kf, reference(kf.spec)):
        assert each.predict([math.nan]) == Status.OK  # waits
        assert each.update("m", [3.0], [math.nan], inputs=[1.0, 0.0]) == Status.NOT_FINITE
        assert each.update("m", [3.0], [0.5], inputs=[math.nan, 0.0]) == Status.NOT_FINITE
        assert each.update("m", [3.0], [0.5], inputs=[1.0, math.nan]) == Status.OK
        assert each.x == pytest.approx([4.0, 0.5])
        assert each.predict([0.0]) == Status.OK
        assert each.update("m", [3.0], [math.nan], inputs=[math.nan, 0.0]) == Status.NOT_FINITE
        assert each.update("m", [3.2], [math.nan], inputs=[1.0, math.nan]) == Status.OK
    ref = reference(kf.spec)
    for each in (kf, ref):
        each.init()
        each.update("m", [3.0], [0.5], inputs=[1.0, 0.0])
        for k in range(5):
            each.predict([0.1])
            each.update("m", [3.0 + 0.1 * k], [0.5], inputs=[1.0, 0.0])
    np.testing.assert_allclose(kf.x, ref.x, rtol=1e-12)


def test_cost_counts_their_calls() -> None:
    from kfgen.cost.job import make_job

    generated = build(loads(text_of("ekf") + "outputs: {speed: {value: 'hypot(vx, vy)'}}\n"))
    job = make_job(generated, simulate(generated.spec, 10))
    functions = [step.function for step in job.steps]
    assert functions.count("update_beacon") == 10
    assert functions.count("get_outputs") == 10
    assert not job.functions["get_outputs"]  # of no part in the filter's flash
    (first,) = [step for step in job.steps if step.function == "update_beacon"][:1]
    assert len(first.values["z_beacon"]) == 6
    assert "ranging_get_outputs(&ranging_kfgen_kf, &ranging_kfgen_value, &ranging_kfgen_std)" in job.driver()
