"""What the first measurements of sensors set: by expressions, from several sensors, with variances."""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

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
name: start
scalar: SCALAR
dt: 0.1
parameters: {tilt: {value: 0.2, range: [0, 1]}}
states:
  px: {init: 0, std: 10, unit: m, range: [-200, 200]}
  py: {init: 0, std: 10, unit: m, range: [-200, 200]}
  th: {init: 0, std: 1, kind: angle}
  v: {init: 1, std: 1, bounds: [0, 20]}
  b: {init: 0, std: 0.1, range: [-1, 1]}
covariances: [[px, v, 2], [py, v, -3], [th, b, 0.05], [px, py, 20]]
inputs: {w: {range: [-1, 1]}, heading0: {range: [-3, 3]}, unread: {range: [-1, 1]}}
dynamics:
  f: {px: "px + 0.1*v*cos(th)", py: "py + 0.1*v*sin(th)", th: "th + 0.1*(w - b)"}
  Q: {px: 0.01, py: 0.01, th: 1e-4, v: 0.01, b: 1e-6}
measurements:
  fix: {partial: true, inputs: {off: {range: [-5, 5]}, acc: {range: [0.5, 3]}},
        z: {v: {h: px + off, std: acc, range: [-200, 200]}, e: {h: py, std: acc, range: [-200, 200]}}}
  compass: {z: {m: {h: th, std: 0.1, kind: angle}}}
  wheel: {z: {s: {h: v, std: 0.2, range: [0, 30]}}}
initialize: INITIALIZE
filter: {FILTER}
"""
# `v` and `e` are components here, not the speed and not 2.718
ONE = """{from: fix, states: {px: v - off, py: "2*e - e", th: heading0 + tilt, v: "abs(v) + 100"},
         var: {px: acc**2, py: 4, v: 0.5}}"""
SEVERAL = """
  - {from: fix, states: {px: v - off, py: e}, var: {px: acc**2, py: acc**2}}
  - {from: compass, states: {th: m + tilt}, var: {th: 0.01}}
"""
BANK = """imm:
  modes: {calm: {}, wild: {filter: {type: ukf, covariance: sqrt}}}
  transition: [[0.95, 0.05], [0.05, 0.95]]
  mu0: [0.5, 0.5]
"""
FILTERS = {
    "ud": "type: ekf", "full": "type: ekf, covariance: full", "sqrt": "type: ekf, covariance: sqrt",
    "joseph": "type: ekf, covariance: full, update: joseph", "iekf": "type: iekf", "ukf": "type: ukf",
    "ukf full": "type: ukf, covariance: full", "floor": "type: ekf, variance_floor: {px: 1e-4}",
}  # fmt: skip
SHAPES = {**{name: (chosen, "") for name, chosen in FILTERS.items()}, "imm": ("type: ekf", BANK),
          "loops": ("type: ekf", "code: {unroll: none}\n"),
          "loops sqrt": ("type: ekf, covariance: sqrt", "code: {unroll: none}\n")}  # fmt: skip
RULES = {"one": ONE, "several": SEVERAL}
KEYS = list(itertools.product(SHAPES, RULES))


def text_of(shape: str, rule: str, scalar: str = "double") -> str:
    chosen, more = SHAPES[shape]
    return TEXT.replace("FILTER", chosen).replace("INITIALIZE", RULES.get(rule, rule)).replace("SCALAR", scalar) + more


@cache
def _filters() -> dict[tuple[str, str], NativeFilter]:
    texts = {key: text_of(*key).replace("start", f"start_{i}") for i, key in enumerate(KEYS)}
    return dict(zip(texts, load_filters([build(loads(text)) for text in texts.values()]), strict=True))


def both(shape: str, rule: str) -> tuple[NativeFilter, Any]:
    kf = _filters()[shape, rule].copy()
    kf.init()
    return kf, reference(kf.spec)


def alike(kf: NativeFilter, ref: Any) -> None:
    np.testing.assert_allclose(kf.x, ref.x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_expressions_and_variances(shape: str) -> None:
    kf, ref = both(shape, "one")
    for each in (kf, ref):
        for k in range(3):
            assert each.predict([0.1 * k, 0.0, 0.0]) < ERROR  # which goes on meanwhile
        assert each.update("wheel", [1.5]) < ERROR
    before = ref.P
    u, own = [0.0, 3.1, 0.0], [1.5, 2.0]
    for each in (kf, ref):
        assert not getattr(each, "raw", {}).get("initialized", False)
        assert each.update("fix", [-30.0, 40.0], u, inputs=own) == Status.OK
        assert each.nis == 0
    alike(kf, ref)
    assert kf.raw["initialized"]
    assert kf.x[:4] == pytest.approx([-31.5, 40.0, 3.3 - 2 * math.pi, 20.0])  # wrapped, and within its bounds
    wanted = before.copy()
    for i, variance in ((0, 4.0), (1, 4.0), (3, 0.5)):
        wanted[i, :] = wanted[:, i] = 0.0
        wanted[i, i] = variance
    np.testing.assert_allclose(kf.P, wanted, rtol=1e-8, atol=1e-9)
    for each in (kf, ref):  # and then it is an update like any other
        for k in range(4):
            assert each.predict([0.2, 0.0, 0.0]) < ERROR
            assert each.update("fix", [-29.0 + k, 41.0], u, inputs=own) < ERROR
        assert each.nis > 0
    alike(kf, ref)


@pytest.mark.parametrize("shape", ["ud", "imm"])
def test_a_whole_log(shape: str) -> None:
    for rule in RULES:
        kf, ref = both(shape, rule)
        log = simulate(kf.spec, 30, every={"compass": 7, "fix": 3})
        result, wanted = kf.run(log), ref.run(log.columns)
        np.testing.assert_allclose(result.x, wanted.x, atol=1e-8)
        np.testing.assert_allclose(result.var, wanted.var, rtol=1e-7)


@pytest.mark.parametrize("shape", SHAPES)
def test_all_else_waits_for_several(shape: str) -> None:
    kf, ref = both(shape, "several")
    nothing = [math.nan] * 3
    u = [0.0, 0.0, 0.0]

    def waits(each: Any) -> None:
        before = bytes(each) if each is kf else (each.x.tobytes(), each.P.tobytes())
        assert each.predict(nothing) == Status.OK
        assert each.update("wheel", [5.0]) == Status.OK
        assert (bytes(each) if each is kf else (each.x.tobytes(), each.P.tobytes())) == before

    for each in (kf, ref):
        waits(each)
        assert each.update("compass", [3.1]) == Status.OK
        assert each.x[2] == pytest.approx(3.3 - 2 * math.pi)
        assert each.P[2, 2] == pytest.approx(0.01)
        assert each.P[2, 4] == pytest.approx(0.0, abs=1e-15)
        waits(each)
        before = bytes(each) if each is kf else b""
        assert each.update("compass", [1.0]) == Status.OK  # it has come already, and waits too
        assert each.update("fix", [3.0, math.nan], mask=0b01, inputs=[0.0, 1.0]) == Status.OK  # not all of it
        assert each is ref or bytes(each) == before
        assert each.update("fix", [7.0, 8.0], inputs=[1.0, 3.0]) == Status.OK
        assert each.x[:2] == pytest.approx([6.0, 8.0])
        assert each.P[0, 0] == pytest.approx(9.0)
    fields = kf.raw
    assert all(fields[name] for name in ("initialized", "initialized_fix", "initialized_compass"))
    alike(kf, ref)
    for each in (kf, ref):
        assert each.predict(u) < ERROR
        assert each.update("compass", [3.2]) < ERROR
        assert each.update("wheel", [1.5]) < ERROR
        assert each.nis > 0
    alike(kf, ref)
    for each in (kf, ref):
        each.init()
        assert each.predict(nothing) == Status.OK


@pytest.mark.parametrize("shape", ["ud", "full", "sqrt", "imm", "loops"])
def test_what_is_read_is_tested_and_no_more(shape: str) -> None:
    bad = math.nan
    kf, ref = both(shape, "one")
    u, own, z = [0.0, 3.1, bad], [1.5, 2.0], [-30.0, 40.0]
    before = bytes(kf)
    for each in (kf, ref):
        assert each.update("fix", z, [0.0, bad, 0.0], inputs=own) == Status.NOT_FINITE
        assert each.update("fix", z, u, inputs=[bad, 2.0]) == Status.NOT_FINITE
        assert each.update("fix", [bad, 40.0], u, inputs=own) == Status.NOT_FINITE
        each.parameters["tilt"] = bad
        assert each.update("fix", z, u, inputs=own) == Status.NOT_FINITE
        each.parameters["tilt"] = 0.2
    assert bytes(kf) == before
    for each in (kf, ref):
        assert each.update("fix", z, u, inputs=own) == Status.OK
        each.parameters["tilt"] = bad  # what only the first measurement reads
        assert each.update("fix", z, [bad, bad, bad], inputs=own) < ERROR
    alike(kf, ref)


def test_with_too_few_components_it_is_an_update() -> None:
    kf, ref = both("ud", "one")
    for each in (kf, ref):
        # nothing of what the first measurement reads is asked for
        assert each.update("fix", [math.nan, 2.0], [0.0, math.nan, 0.0], mask=0b10, inputs=[math.nan, 2.0]) < ERROR
        assert each.nis > 0
    assert not kf.raw["initialized"]
    alike(kf, ref)


def test_a_variance_below_zero_is_refused() -> None:
    text = text_of("ud", "{from: fix, states: {px: v}, var: {px: acc, py: e}}")
    (kf,) = load_filters([build(loads(text))])
    for each in (kf, reference(kf.spec)):
        before = each.x.copy()
        assert each.update("fix", [1.0, -2.0], inputs=[0.0, 1.0]) == Status.NOT_POSITIVE
        assert each.update("fix", [1.0, 2e308], inputs=[0.0, 1.0]) == Status.NOT_FINITE
        np.testing.assert_array_equal(each.x, before)
        assert each.update("fix", [1.0, 0.0], inputs=[0.0, 0.0]) == Status.OK  # 0: known exactly
        assert each.P[0, 0] == 0
        assert each.P[1, 1] == 0


def test_a_list_of_one_waits() -> None:
    text = text_of("ud", "[{from: compass, states: {th: m}}]")
    (kf,) = load_filters([build(loads(text))])
    for each in (kf, reference(kf.spec)):
        x = each.x.copy()
        assert each.predict([1.0, 0.0, 0.0]) == Status.OK
        np.testing.assert_array_equal(each.x, x)
        assert each.update("compass", [0.5]) == Status.OK
        assert each.predict([1.0, 0.0, 0.0]) < ERROR
        assert each.x[0] != x[0]


def test_points_that_were_kept_are_drawn_anew() -> None:
    text = text_of("ud", "{from: fix, states: {px: v}, var: {px: 0.25}}")
    text = "\n".join(line for line in text.splitlines() if not line.startswith(("  compass:", "  wheel:")))
    text = text.replace("{type: ekf}", "{type: ukf, covariance: full, sigma_points: {redraw: false}}")
    (kf,) = load_filters([build(loads(text))])
    ref = reference(kf.spec)
    for each in (kf, ref):
        assert each.predict([0.1, 0.0, 0.0]) < ERROR
        assert each.update("fix", [4.0, 2.0], inputs=[0.0, 1.0]) == Status.OK
        assert each.update("fix", [4.1, 2.0], inputs=[0.0, 1.0]) < ERROR
    alike(kf, ref)


@pytest.mark.parametrize("scalar", ["float", "q16.16"])
@pytest.mark.parametrize(("shape", "rule"), [("ud", "one"), ("sqrt", "several"), ("full", "several"), ("imm", "one")])
def test_in_other_scalars(shape: str, rule: str, scalar: str) -> None:
    (kf,) = load_filters([build(loads(text_of(shape, rule, scalar)))])
    ref = reference(kf.spec)
    u = [0.1, 0.5, 0.0]
    for each in (kf, ref):
        for k in range(20):
            assert each.predict(u) < ERROR
            assert each.update("fix", [-30.0 + k, 40.0], u, inputs=[1.0, 1.5]) < ERROR
            assert each.update("compass", [0.1]) < ERROR
    sigma = np.sqrt(ref.P.diagonal())
    near = 2e-3 if scalar == "float" else 0.1
    assert (np.abs(kf.x - ref.x) < near * sigma).all()
    assert (np.abs(kf.P.diagonal() - ref.P.diagonal()) < near * ref.P.diagonal()).all()


@pytest.mark.parametrize("shape", ["ud", "sqrt", "loops", "loops sqrt"])
def test_factors_of_any_covariance(shape: str) -> None:
    """Also of one without rank, with numbers of very different size: nothing can fail."""
    kf, ref = both(shape, "one")
    rng = np.random.default_rng(1)
    for rank in (1, 2, 4, 5):
        A = rng.normal(size=(5, rank)) * 10.0 ** rng.uniform(-3, 3, (5, 1))
        for each in (kf, ref):
            each.init()
            assert each.set_covariance(A @ A.T) == Status.OK
            assert each.update("fix", [1.0, 2.0], [0.0, 0.0, 0.0], inputs=[0.0, 2.0]) == Status.OK
        scale = np.sqrt(np.outer(ref.P.diagonal(), ref.P.diagonal()))
        assert (np.abs(kf.P - ref.P) <= 1e-9 * scale).all()
