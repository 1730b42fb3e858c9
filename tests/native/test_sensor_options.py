"""Options that a sensor has of its own, thresholds at run time, R of parameters: the compiled filter against the
reference."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from poison import BANK, PAIRS, filled

from kfgen.errors import SpecError
from kfgen.generate import generate
from kfgen.native import compile as compile_filter
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import Status

TEXT = """
kfgen: 1
name: own
scalar: double
dt: 0.1
parameters: {limit: 9, s: 0.7, r: {value: 0.5, range: [0.1, 5]}}
inputs: {reach: {}}
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}
dynamics: {f: {p: p + dt*v, v: 0.99*v}, Q: {v: 0.1}}
measurements:
  m: {z: {p: {h: p, std: 1}, v: {h: v, std: 1}}FIRST}
  n: {z: {p: {h: p, std: 1}}}
  c: {z: {p: {h: p, std: 1}}SECOND}
filter: {FILTER}
code: {CODE}
"""
CASES = [
    ("type: ekf", "robust: huber", "adaptive: true"),
    ("type: ekf, robust: chernodarov, adaptive: true, adapt_R: 0.01", "robust: none, adaptive: none", "adapt_R: none"),
    ("type: ekf, covariance: full", "adapt_R: 0.05", "robust: {influence: huber, k: 1}"),
    ("type: ukf, covariance: full, adaptive: true", "adaptive: none", "adapt_R: 0.01"),
    ("type: ukf, sequential: true", "robust: huber", "adaptive: {chi2: 4}"),
    ("type: ekf, covariance: sqrt", "robust: {psi: tanh(e)}", "adaptive: true"),
    ("type: kf, covariance: full, adapt_R: 0.02", "adapt_R: none", "robust: huber, adaptive: true"),
    ("type: iekf", "robust: none", "adaptive: false"),
]  # fmt: skip


def spec_text(chosen: str, first: str = "", second: str = "", code: str = "unroll: full") -> str:
    text = TEXT.replace("FILTER", chosen).replace("CODE", code)
    return text.replace("FIRST", f", {first}" if first else "").replace("SECOND", f", {second}" if second else "")


@pytest.mark.parametrize("code", ["unroll: full", "unroll: none"])
@pytest.mark.parametrize(("chosen", "first", "second"), CASES)
def test_options_of_a_sensor(chosen, first, second, code):
    spec = loads(spec_text(chosen, first, second, code))
    filters: list[Any] = [compile_filter(spec), reference(spec)]
    statuses = []
    for kf in filters:
        random, found = np.random.default_rng(1), []
        for i in range(30):
            found.append(kf.predict(u=[0]))
            for sensor, m, every in (("m", 2, 7), ("n", 1, 5), ("c", 1, 6)):
                found.append(kf.update(sensor, random.normal(size=m) * (8 if i % every == 0 else 1)))
        statuses.append(found)
    assert statuses[0] == statuses[1]
    np.testing.assert_allclose(filters[0].P, filters[1].P, rtol=1e-7)
    np.testing.assert_allclose(filters[0].x, filters[1].x, rtol=1e-7, atol=1e-9)
    learning = {name for name, own in (("m", first), ("n", ""), ("c", second)) if _learns(chosen, own)}
    for name in learning:
        np.testing.assert_allclose(filters[0].R[name], filters[1].R[name], rtol=1e-7)
    assert {name for name in "mnc" if filters[0].struct.has(f"get_R_{name}")} == learning


def _learns(chosen: str, own: str) -> bool:
    return "adapt_R: 0" in own or ("adapt_R" in chosen and "adapt_R" not in own)


@pytest.mark.parametrize(
    ("chosen", "first", "place"),
    [
        ("type: iekf", "robust: huber", "measurements.m.robust"),
        ("type: ukf, covariance: full", "robust: huber", "measurements.m.robust"),
        ("type: kf, gain: steady", "adaptive: true", "measurements.m.adaptive"),
        ("type: ekf", "adapt_R: 3", "measurements.m.adapt_R"),
        ("type: ekf", "robust: hubert", "measurements.m.robust"),
        ("type: ekf", "adapt_Q: 0.1", "measurements.m.adapt_Q"),
        ("type: ekf", "gate: {probability: 0.9, threshold: 3}", "gate.threshold"),
        ("type: ekf", "gate: {reset_after: 3}", "measurements.m.gate"),
        ("type: ekf", "gate: {threshold: -3}", "greater than 0"),
        ("type: ekf", "gate: {threshold: p}", "may not stand"),
    ],
)
def test_what_is_refused(chosen, first, place):
    with pytest.raises(SpecError, match=place):
        loads(spec_text(chosen, first))


FILTERS = ("type: ekf", "type: ukf, covariance: full", "type: iekf, covariance: full", "type: ekf, covariance: sqrt")


@pytest.mark.parametrize("chosen", FILTERS)
def test_thresholds_at_run_time(chosen):
    gates = ('gate: {threshold: "limit*(1 + exp(reach))", reset_after: 2}, partial: true', "gate: {threshold: limit}")
    spec = loads(spec_text(chosen, *gates))
    found = []
    for kf in (compile_filter(spec), reference(spec)):
        u = [-1.0]
        statuses = [kf.predict(u=u), kf.update("m", [1, 1], u=u)]
        statuses += [kf.update("m", [9, 9], u=u) for _ in range(4)]
        statuses += [kf.update("m", [9, 9], u=u, mask=1), kf.update("c", [30])]
        kf.parameters["limit"] = 1e4
        statuses += [kf.update("c", [30]), kf.update("m", [0, 0], u=[1000.0])]
        kf.parameters["limit"] = math.nan
        statuses += [kf.update("c", [8]), kf.update("m", [8, 8], u=u, mask=2), kf.update("n", [1]), kf.predict(u=u)]
        found.append(statuses)
    assert found[0] == found[1]
    assert {Status.GATED, Status.ANOMALY, Status.NOT_FINITE} <= set(found[0])


@pytest.mark.parametrize("code", ["unroll: full", "unroll: none"])
@pytest.mark.parametrize("chosen", ["type: ekf", "type: ekf2, covariance: full", "type: ukf", FILTERS[-1]])
def test_adapted_R_starts_from_parameters(chosen, code):
    """At their spec values; what becomes of them later is not read."""
    text = spec_text(f"{chosen}, adapt_R: 0.05", code=code).replace("v: {h: v, std: 1}", "v: {h: v + 0.1*p**2, var: r}")
    spec = loads(text.replace("n: {z: {p: {h: p, std: 1}}}", "n: {z: {p: {h: p}}, R: [[s**2]]}"))
    kf, ref = compile_filter(spec), reference(spec)
    np.testing.assert_allclose(kf.R["m"], np.diag([1, 0.5]))
    np.testing.assert_allclose(kf.R["n"], [[0.49]])
    for each in (kf, ref):
        each.parameters["s"], each.parameters["r"] = math.nan, 7
        for z in range(10):
            assert each.predict(u=[0]) | each.update("m", [0.1 * z, 1]) | each.update("n", [z]) == 0
    np.testing.assert_allclose(kf.R["m"], ref.R["m"], rtol=1e-9)
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-9)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_modes_have_a_covariance_and_nis(first, second):
    spec = loads(filled(BANK, {"FIRST": first, "SECOND": second, "GATE": ", gate: {probability: 0.9}"}))
    kf, ref = compile_filter(spec, scalar="double"), reference(spec)
    for z in (0.4, 0.5, 0.7, 50):
        for each in (kf, ref):
            each.predict(u=[0.1, 0, 0])
            each.update("two", [z, 0.1], u=[0, 0.1, 0])
            status = each.update("one", [z])
        for mode, other in zip(kf.modes, ref.modes, strict=True):
            np.testing.assert_allclose(mode.P, other.P, rtol=1e-9)
            assert mode.nis == pytest.approx(other.nis, rel=1e-9)
    assert status == Status.GATED


@pytest.mark.parametrize("form", ["ud, update: joseph", "full, update: joseph"])
@pytest.mark.parametrize("code", ["unroll: full", "unroll: none"])
def test_a_limited_gain_is_flagged(form, code):
    text = spec_text(f"type: ekf, covariance: {form}, gain_limit: 0.6", code=code)
    for changed in ("gain_limit: 0.6", "gain_limit: 0.6, consider: [p]", "gain_limit: 0.4, consider: [v]"):
        spec = loads(text.replace("gain_limit: 0.6", changed))
        found = []
        for kf in (compile_filter(spec), reference(spec)):
            found.append([kf.update("n", [1.0]), kf.update("n", [1.0]), kf.predict(u=[0]), kf.update("m", [0, 0])])
        assert found[0] == found[1]
        if "consider: [v]" in changed:
            assert found[0][0] == Status.REGULARIZED


EMPTY = """
kfgen: 1
name: empty
scalar: SCALAR
states: {x: {init: 1, std: 1, range: [-10, 10]}}
dynamics: {f: F}
measurements: {m: {z: {z: {h: x, std: 1}}}}
filter: {FILTER}
"""
STRICT = [
    "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wshadow",
    "-Wfloat-equal", "-Wundef", "-Werror", "-c",
]  # fmt: skip


@pytest.mark.parametrize("scalar", ["float", "q16.16", "q24.8"])
def test_little_models_leave_nothing_unused(tmp_path: Path, scalar: str):
    names = []
    for chosen, f in (
        ("type: kf", "{}"), ("type: ukf, covariance: full, reject: non_finite", "{}"),
        ("type: ukf, sigma_points: {redraw: false}", "{}"), ("type: kf, covariance: sqrt", "{}"),
    ):  # fmt: skip
        text = EMPTY.replace("FILTER", chosen).replace("SCALAR", scalar).replace("f: F", f"f: {f}")
        names += _written(tmp_path, text, f"e{len(names)}")
    steady = EMPTY.replace("FILTER", "type: kf, gain: steady").replace("f: F", "f: {x: 0.9*x}, Q: {x: 0.1}")
    names += _written(tmp_path, steady.replace("SCALAR", scalar), "steady")
    done = subprocess.run(["cc", *STRICT, *names], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def _written(folder: Path, text: str, name: str) -> list[str]:
    files = generate(loads(text.replace("name: empty", f"name: {name}")))
    for file, content in files.items():
        (folder / file).write_text(content)
    return [file for file in files if file.endswith(".c")]
