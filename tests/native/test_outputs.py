"""What firmware reads of an estimate, with standard deviations: the compiled filter against the reference."""

from __future__ import annotations

import math
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_sensor_inputs import BANK, FILTERS, TEXT

from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.reference import reference
from kfgen.selftest import selftest
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import Status

OUTPUTS = """let: {course: "atan2(vy, vx)"}
outputs:
  speed: {value: "hypot(vx, vy)", unit: m/s, doc: over ground}
  bearing: {value: "atan2(py, px)*180/pi", unit: deg}
  scaled: {value: "s0*px + t"}
  turned: {value: cos(course)}
  twice: {value: "[2*px, 2*py]"}
  constant: {value: 3*s0}
"""
STEADY = """
kfgen: 1
name: steady
scalar: double
dt: 0.1
states: {p: {init: 1, std: 1}, v: {init: 2, std: 1}}
dynamics: {f: {p: p + dt*v}, Q: {v: 0.1}}
measurements: {m: {z: {p: {h: p, std: 1}}}}
outputs: {both: {value: p + 2*v}, square: {value: v**2}}
filter: {type: kf, gain: steady}
"""
SHAPES = {**{name: (FILTERS[name], "") for name in ("ekf", "full", "sqrt", "ukf", "sequential")},
          "loops": ("type: ekf", "code: {unroll: none}\n"), "imm": ("type: ekf", BANK)}  # fmt: skip


def text_of(shape: str, scalar: str = "double", outputs: str = OUTPUTS) -> str:
    chosen, more = SHAPES[shape]
    return TEXT.replace("FILTER", chosen).replace("SCALAR", scalar) + more + outputs


@cache
def _filters() -> dict[str, NativeFilter]:
    texts = {shape: text_of(shape).replace("ranging", f"ranging_{i}") for i, shape in enumerate(SHAPES)}
    made = {shape: build(loads(text)) for shape, text in {**texts, "steady": STEADY}.items()}
    return dict(zip(made, load_filters(list(made.values())), strict=True))


def filter_of(shape: str) -> NativeFilter:
    kf = _filters()[shape].copy()
    kf.init()
    return kf


@pytest.mark.parametrize("shape", [*SHAPES, "steady"])
def test_agrees_with_the_reference(shape: str) -> None:
    kf = filter_of(shape)
    log = simulate(kf.spec, 40)
    result, wanted = kf.run(log), reference(kf.spec).run(log.columns)
    assert list(result.outputs) == [output.name for output in kf.spec.outputs]
    for name, y in wanted.outputs.items():
        sigma = wanted.output_std[name]
        np.testing.assert_allclose(result.outputs[name], y, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(result.output_std[name], sigma, rtol=1e-7, atol=1e-12)
        assert kf.outputs[name] == result.outputs[name][-1]
        assert kf.output_std[name] == result.output_std[name][-1]
    if shape != "steady":
        assert (result.output_std["constant"] == 0).all()


@pytest.mark.parametrize("shape", ["ekf", "imm"])
@pytest.mark.parametrize(("scalar", "near"), [("float", 1e-4), ("q16.16", 3e-3)])
def test_in_other_scalars(shape: str, scalar: str, near: float) -> None:
    generated = build(loads(text_of(shape, scalar)))
    (kf,) = load_filters([generated])
    log = simulate(kf.spec, 40)
    result, wanted = kf.run(log), reference(kf.spec).run(log.columns)
    for name, y in wanted.outputs.items():
        sigma = wanted.output_std[name]
        assert np.abs(result.outputs[name] - y).max() < near * max(1.0, np.abs(y).max()), name
        assert np.abs(result.output_std[name] - sigma).max() < near * max(1.0, sigma.max()), name
    if scalar == "q16.16":
        assert "#define RANGING_TWICE_X_LSB " in generated.files["ranging.h"]


def test_never_a_root_of_a_negative_number() -> None:
    """Rounding may leave J P J^T of a covariance without rank below 0."""
    text = text_of("full", "float", "outputs: {between: {value: px - py}, sum: {value: '1000*px - 1000*py'}}\n")
    (kf,) = load_filters([build(loads(text))])
    for scale in (1.0, 1.1, 3.3, 7.77):
        P = np.zeros((4, 4))
        P[:2, :2] = scale
        kf.set_covariance(P)
        assert all(0 <= sigma < 2 for sigma in kf.output_std.values())


def test_what_is_not_finite_is_refused() -> None:
    text = text_of("ekf", outputs="outputs: {root: {value: sqrt(px - 100)}, plain: {value: s0*py}}\n")
    (kf,) = load_filters([build(loads(text))])
    ref = reference(kf.spec)
    ffi = kf.struct.ffi
    value, std = (ffi.new("ranging_outputs_t *", [7.0, 8.0]) for _ in range(2))
    assert kf.struct.call("get_outputs", value, std) == Status.NOT_FINITE
    assert [value.root, value.plain, std.root, std.plain] == [7.0, 8.0, 7.0, 8.0]
    for each in (kf, ref):
        assert all(map(math.isnan, each.outputs.values()))
        each.set_state([101.0, 2.0, 0.0, 0.0])
        assert each.outputs["root"] == pytest.approx(1.0)
        each.parameters["s0"] = math.nan
        assert all(map(math.isnan, each.outputs.values()))


def test_null_pointers() -> None:
    kf = filter_of("ekf")
    ffi, name = kf.struct.ffi, kf.name
    value, std = (ffi.new(f"{name}_outputs_t *") for _ in range(2))
    before = bytes(kf)
    assert kf.struct.call("get_outputs", value, ffi.NULL) == 0
    assert value.scaled == kf.outputs["scaled"]
    assert kf.struct.call("get_outputs", ffi.NULL, std) == Status.NULL_ARGUMENT
    assert getattr(kf.struct.lib, f"{name}_get_outputs")(ffi.NULL, value, std) == Status.NULL_ARGUMENT
    assert bytes(kf) == before


def test_a_spec_without_outputs_has_none() -> None:
    spec = loads(text_of("ekf", outputs=""))
    generated = build(spec)
    (kf,) = load_filters([generated])
    assert "outputs" not in generated.files["ranging.h"]
    for each in (kf, reference(spec)):
        with pytest.raises(AttributeError, match="outputs"):
            _ = each.outputs
        with pytest.raises(AttributeError, match="output"):
            _ = each.output_std


def test_the_header_tells_units() -> None:
    header = build(loads(text_of("ekf"))).files["ranging.h"]
    assert "ranging_real_t speed;    /* [m/s] over ground */" in header
    assert "speed [m/s], bearing [deg], scaled" in header
    assert "their standard deviations, or NULL" in header


@pytest.mark.parametrize(("shape", "scalar"), [("ekf", "float"), ("imm", "double"), ("ukf", "q16.16")])
def test_the_self_test_asks_for_them(shape: str, scalar: str, tmp_path: Path) -> None:
    spec = loads(text_of(shape, scalar))
    generated = build(spec)
    files = {**generated.files, **selftest(spec, generated)}
    test = files["ranging_selftest.c"]
    assert "ranging_get_outputs(" in test
    files["main.c"] = "int ranging_selftest(void);\nint main(void) { return ranging_selftest(); }\n"
    for wrong in (False, True):
        if wrong:  # a filter whose outputs are wrong
            files["ranging.c"] = files["ranging.c"].replace("value->speed = speed;", "value->speed = speed / 2;")
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        subprocess.run(
            "gcc -std=c99 -Wall -Wextra -Wconversion -Werror ranging.c ranging_selftest.c main.c -o run -lm",
            cwd=tmp_path, shell=True, check=True,
        )  # fmt: skip
        assert (subprocess.run(["./run"], cwd=tmp_path, check=False).returncode != 0) == wrong
