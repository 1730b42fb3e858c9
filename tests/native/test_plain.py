"""`--json`: what commands print as figures, as data."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from kfgen.cli import cli

SPEC = """kfgen: 1
name: level
dt: 1
states: {x: {init: 0, var: 1, range: [-5, 5]}}
dynamics: {form: discrete, f: {}, Q: {x: 0.01}}
measurements: {gauge: {z: {h: {h: x, var: 0.1}}, gate: {probability: 0.9}}}
filter: {type: kf}
"""


@pytest.fixture
def kfgen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("level.yaml").write_text(SPEC)
    Path("log.csv").write_text("gauge.h\n" + "\n".join(["0.1"] * 8 + ["9", ""]) + "\n")

    def call(*arguments, status=0):
        result = CliRunner().invoke(cli, [*arguments, "--json"], prog_name="kfgen")
        assert result.exit_code == status, result.output
        return json.loads(result.stdout)

    return call


def test_build(kfgen):
    (found,) = kfgen("build", "level.yaml")
    assert (found["name"], found["scalar"], found["states"], found["sensors"]) == ("level", "float", 1, {"gauge": 1})
    assert found["functions"]["update_gauge"]["flash"] > found["functions"]["predict"]["flash"] > 0
    assert found["functions"]["predict"]["operations"] == {"add": 1}
    assert all(Path(path).exists() for path in found["files"])
    assert found["ram"] == 12


def test_check(kfgen):
    found = kfgen("check", "level.yaml")
    assert found["passed"]
    assert found["error_x"]["error"] < found["tolerance"] == 2e-3
    fixed = kfgen("check", "level.yaml", "--scalar", "q16.16")
    assert fixed["scalar"] == "q16.16"
    assert fixed["certificate"]


def test_run(kfgen):
    found = kfgen("run", "level.yaml", "log.csv")
    assert found["rows"] == 9
    assert found["errors"] == {}
    assert found["warnings"] == {"update_gauge": {"GATED": 1}}
    assert found["nis"]["gauge"] > 0
    kfgen("run", "level.yaml", "log.csv", "-o", "out.csv")
    assert len(Path("out.csv").read_text().splitlines()) == 10
