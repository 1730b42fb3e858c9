"""Predictions against measurements, and what becomes of a spec whose budgets are too small."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from kfgen.cli import cli
from kfgen.cost import measure, recommended_flags
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.ir import footprint
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import load, loads
from tests.benchmarks.calibrate import compiled
from tests.oracle import problems

ROOT = Path(__file__).parents[2]
SPECS = sorted((ROOT / "specs").glob("*.yaml"))
WITHIN = 0.25


def measured(spec):
    generated = build(spec, judge=False)
    flags = recommended_flags(generated.view)
    return generated.summary.prediction, measure(generated, simulate(spec, 20), flags=flags)  # the deepest paths


def test_every_spec_is_predicted(needs):
    needs("arm-none-eabi-gcc")
    specs = [load(path) for path in SPECS]
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(measured, specs))
    for spec, (prediction, cost) in zip(specs, results, strict=True):
        totals = prediction.totals
        assert abs(totals["flash"] / cost.flash - 1) <= WITHIN, (spec.name, totals["flash"], cost.flash)
        assert totals["ram"] == cost.ram
        assert sum(prediction.ram.values()) <= cost.ram < sum(prediction.ram.values()) + 8
        assert abs(totals["stack"] - cost.stack) <= max(40, 0.4 * cost.stack), (spec.name, totals["stack"], cost.stack)


def compiled_flash(spec):
    """Bytes of what a prediction is of, as compiled and not linked."""
    generated = build(spec, judge=False)
    flags = recommended_flags(generated.view)
    flash, _ = compiled(spec.name, generated.files, flags)
    rest = rf"{spec.name}_(set_|get_|redraw|update_\w+_masked)"
    found = sum(size for name, size in flash.items() if not re.match(rest, name))
    return generated.summary.prediction.totals["flash"], found


# of fixed point, whose files take long to compile, the small ones
@pytest.mark.parametrize(("scalar", "names"), [
    (None, [path.stem for path in SPECS]),
    pytest.param("q16.16", ["battery", "cv4", "pendulum", "scalar", "vehicle_tutorial"], marks=pytest.mark.long),
])  # fmt: skip
def test_loops_and_fixed_point_are_predicted(needs, scalar, names):
    needs("arm-none-eabi-gcc")
    specs = [load(ROOT / "specs" / f"{name}.yaml") for name in names]
    specs = [override(spec, scalar or spec.scalar) for spec in specs]
    specs = [replace(spec, code=replace(spec.code, unroll="none")) for spec in specs]
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(compiled_flash, specs))
    for spec, (predicted, found) in zip(specs, results, strict=True):
        assert abs(predicted / found - 1) <= WITHIN, (spec.name, predicted, found)


UNSEEN = """
kfgen: 1
name: unseen
dt: {nominal: 0.02, min: 0.001}
states:
  h: {init: 0, std: 5}
  v: {init: 0, std: 1}
  b: {init: 0, std: 0.3, bounds: [-1, 1]}
  g: {init: 1, std: 0.1}
inputs: {a: {range: [-20, 20]}}
noise: {w: {std: 0.4}}
dynamics: {form: continuous, f: {h: v, v: "g*(a + w) - b - 0.01*v*abs(v)", b: "-b/100"}, Q: {b: 1e-4, g: 1e-6}}
measurements:
  baro: {z: {p: {h: "1013*exp(-h/8400)", std: 0.1}}, gate: {probability: 0.999}}
  lidar: {z: {d: {h: "hypot(h, 2)", std: 0.02}, f: {h: h - v, std: 0.1}}}
filter: {type: %s}
"""


@pytest.mark.parametrize(
    "form", ["ekf", "ekf, update: joseph", "ekf, covariance: full, robust: chernodarov", "ukf", "iekf, iterations: 3"]
)
def test_a_filter_that_calibration_has_not_seen(needs, form):
    needs("arm-none-eabi-gcc")
    prediction, cost = measured(loads(UNSEEN % form))
    assert abs(prediction.totals["flash"] / cost.flash - 1) <= WITHIN, (prediction.flash, cost.functions)


def test_a_larger_function_is_predicted_to_be_larger():
    sizes = []
    for n in (4, 8, 12):
        code = build(override(loads(problems.chain(n)), "float")).code
        sizes.append([footprint.predicted([f]) for f in code.functions if f.name in ("predict", "update_position")])
        assert footprint.predicted(code.functions) >= sum(sizes[-1])
    assert sizes == sorted(sizes)


def budgeted(text: str, budgets: str) -> str:
    return text.replace("filter:", f"code: {{{budgets}}}\nfilter:")


def test_a_budget_that_is_kept():
    spec = loads(budgeted(UNSEEN % "ekf", "flash: 16k, ram: 1k, stack: 1k"))
    assert build(spec).files == {
        name: text.replace(loads(UNSEEN % "ekf").sha256, spec.sha256)
        for name, text in build(loads(UNSEEN % "ekf")).files.items()
    }


def test_an_impossible_budget_is_an_error_that_tells_where_the_bytes_go(tmp_path):
    spec = loads(budgeted(problems.VEHICLE4, "flash: 500, ram: 40, stack: 48"))
    with pytest.raises(SpecError) as caught:
        build(override(spec, "float"))
    flash, ram, stack = caught.value.mistakes
    match = re.fullmatch(
        r"about (\d+) bytes of flash on a Cortex-M4F, (\d+) more than the budget of 500 \((.*)\)", flash.message
    )
    assert match
    size, over = int(match[1]), int(match[2])
    assert over == size - 500
    parts = dict(part.rsplit(" ", 1) for part in match[3].split("; "))
    assert set(parts) == {"predict", "update_gnss", "init"}
    assert sum(map(int, parts.values())) == size
    assert flash.place.path == "code.flash"
    assert ram.message.startswith("60 bytes of RAM on a Cortex-M4F, 20 more than the budget of 40 (U 24; x 16; D 16;")
    assert re.search(r"\(.*update_gnss \d+, \d+ too many.*\)", stack.message)
    # in fixed point likewise, the routines by themselves
    with pytest.raises(SpecError) as caught:
        build(override(spec, "q16.16"))
    assert re.search(r"\(.*predict \d+.*; routines \d+.*\)", caught.value.mistakes[0].message)
    # the command: exit status 2, the place, and nothing written, of other specs neither
    (tmp_path / "tight.yaml").write_text(budgeted(problems.VEHICLE4, "flash: 500"))
    (tmp_path / "fine.yaml").write_text(problems.CV4)
    arguments = ["build", str(tmp_path / "fine.yaml"), str(tmp_path / "tight.yaml"), "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 2
    assert re.match(rf"{tmp_path}/tight.yaml:\d+:\d+: code.flash: about \d+ bytes", result.stderr)
    assert not (tmp_path / "out").exists()


def test_cost_verifies_the_budget(needs, tmp_path):
    needs("arm-none-eabi-gcc")
    path = tmp_path / "tight.yaml"
    for budgets, status in (("flash: 500, ram: 1k", 1), ("flash: 8k, ram: 1k, stack: 1k", 0)):
        path.write_text(budgeted(problems.CV4, budgets))
        result = CliRunner().invoke(cli, ["cost", str(path), "--scalar", "float", "--rows", "2"])
        assert result.exit_code == status
        assert ("above the budget of 500" in result.stderr) == bool(status)
    # the budgets are those of a Cortex-M4F
    path.write_text(budgeted(problems.CV4, "flash: 500"))
    assert CliRunner().invoke(cli, ["cost", str(path), "--target", "cortex-m0", "--rows", "2"]).exit_code == 0
