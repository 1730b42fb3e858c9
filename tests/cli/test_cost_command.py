from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from kfgen.cli import cli
from tests.oracle import problems

LONG = problems.chain(8)


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Calls `kfgen cost` in an empty folder, the real generator at work."""
    import sys

    monkeypatch.delitem(sys.modules, "kfgen.generate", raising=False)
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(cli, ["cost", *arguments], prog_name="kfgen")


SMALL = """
kfgen: 1
name: level
dt: 1
states: {x: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: x}, Q: {x: 0.01}}
measurements: {gauge: {z: {h: {h: x, var: 0.1}}}}
filter: {type: kf}
"""


def test_table(call, needs):
    needs("arm-none-eabi-gcc")
    Path("level.yaml").write_text(SMALL)
    result = call("level.yaml", "--mhz", "80", "--rows", "5")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[0] == "level (float) on Cortex-M4 with FPU, over 5 rows of a simulated log"
    assert lines[1].startswith("compiled by arm-none-eabi-gcc")
    assert lines[3] == "with -O2 -fno-math-errno"
    assert lines[4].split() == ["function", "calls", "instructions", "worst", "us,", "estimate", "flash", "stack"]
    assert lines[6].split()[:2] == ["predict", "5"]
    assert lines[-1] == "us: estimated from cycles at 80 MHz, without caches and wait states"
    assert "recommended" not in result.stdout


def test_json_with_and_without_the_recommended_flags(call, needs):
    needs("arm-none-eabi-gcc")
    Path("chain.yaml").write_text(LONG)
    result = call("chain.yaml", "--scalar", "float", "--rows", "3", "--json")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["flags"] == []
    assert "-fno-schedule-insns" in found["recommended"]["flags"]
    assert found["rows"] == found["functions"]["predict"]["calls"] == 3
    assert found["step"] > found["recommended"]["step"] > 500
    assert "microseconds_estimate" not in found["functions"]["predict"]
    assert found["over_budget"] == []


def test_a_log(call, needs):
    needs("arm-none-eabi-gcc")
    Path("level.yaml").write_text(SMALL)
    Path("log.csv").write_text("gauge.h\n1\n\n2\n")
    found = json.loads(call("level.yaml", "--log", "log.csv", "--json").stdout)
    assert found["functions"]["update_gauge"]["calls"] == 2
    assert found["log"] == "log.csv"
    Path("log.csv").write_text("gauge\n1\n")
    result = call("level.yaml", "--log", "log.csv")
    assert result.exit_code == 2
    assert "column `gauge.h` is missing" in result.stderr
