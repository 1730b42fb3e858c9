"""Tuning: against the truth of simulated logs, what it cannot tell, what it refuses, what it writes."""

from __future__ import annotations

import json
import signal
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from kfgen.cli import cli
from kfgen.errors import KfgenError
from kfgen.simulate import simulate
from kfgen.spec import load, loads
from kfgen.tuning import searched, tune, tuned
from kfgen.tuning.numbers import default_slots, slot_of
from kfgen.tuning.objective import Objective
from kfgen.tuning.opened import opened
from kfgen.tuning.writing import spelled

TRUE = """
kfgen: 1
name: tuned
constants: {walk: 0.15}   # of the bias
parameters:
  drive: {value: 0.5, range: [0, 10]}
dt: 0.1
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}, b: {init: 0, std: 0.3}}
dynamics:
  form: discrete
  f: {p: p + dt*v, v: 0.98*v}
  Q: {v: "drive**2*dt", b: "walk**2*dt"}
measurements:
  fix: {z: {p: {h: p, std: 0.3}, s: {h: v + b, std: 0.2}}}
  level: {z: {b: {h: b, var: "4*dt**2"}}}
filter: {type: kf}
"""
WRONG = (TRUE.replace("0.15}", "0.02}").replace("value: 0.5", "value: 3").replace("h: p, std: 0.3", "h: p, std: 2")
         .replace("v + b, std: 0.2", "v + b, std: 0.04").replace("4*dt", "25*dt"))  # fmt: skip
PATHS = ["walk", "drive", "fix.z.p.std", "measurements.fix.z.s.std", "level.z.b.var"]
RIGHT = [0.15, 0.5, 0.3, 0.2, 4.0]


@pytest.fixture(scope="module")
def judge():
    """The wrong spec, its slots, and an objective for them, compiled once."""
    spec = loads(WRONG)
    slots = [slot_of(spec, path) for path in PATHS]
    return spec, slots, Objective(opened(spec, slots), [simulate(spec, 3)], 0.2, "likelihood", False)


@pytest.mark.parametrize("runs", [20, pytest.param(100, marks=pytest.mark.long)])
def test_finds_the_true_noises_within_three_standard_errors(judge, runs):
    spec, slots, objective = judge
    truth, within = loads(TRUE), 0
    for seed in range(runs):
        found = searched(spec, slots, objective.over([simulate(truth, 250, seed)]))
        assert found.curvature is not None
        assert found.curvature.unidentified == ()
        distance = np.abs(np.subtract(found.values, RIGHT)) / found.curvature.errors
        within += bool((distance < 3).all())
        assert found.after.likelihood[0] > found.before.likelihood[0]
        assert found.after.likelihood[1] > found.before.likelihood[1]
    assert within >= 0.95 * runs


def test_several_logs_tell_more(judge):
    spec, slots, objective = judge
    logs = [simulate(loads(TRUE), 300, seed) for seed in (1, 2)]
    one, two = (searched(spec, slots, objective.over(some)) for some in (logs[:1], logs))
    assert (two.curvature.errors < one.curvature.errors).sum() >= 4


def test_what_is_free_without_a_word():
    spec = loads(TRUE)
    assert [slot.path for slot in default_slots(spec)] == [
        "constants.walk", "parameters.drive", "measurements.fix.z.p.std", "measurements.fix.z.s.std",
        "measurements.level.z.b.var",
    ]  # fmt: skip


TIED = """
kfgen: 1
name: tied
dt: 0.1
states: {p: {init: 0.5, std: 1}, k: {init: 2, std: 0.5}}
noise: {a: {std: 0.3}, b: {std: 0.4}}
dynamics: {form: discrete, f: {p: 0.95*p + a + b}}
measurements:
  fix: {z: {p: {h: p, std: 0.2}}, gate: {probability: 0.999}}
  bias: {z: {k: {h: 1.5*k, std: 0.1}}}
filter: {type: ekf}
"""


@pytest.fixture(scope="module")
def tied(tmp_path_factory):
    path = tmp_path_factory.mktemp("tied") / "tied.yaml"
    path.write_text(TIED)
    return path


def test_says_what_the_data_cannot_tell(tied):
    spec = load(tied)
    log = simulate(spec, 800, 1)
    found = tune(spec, log, ["noise.a.std", "noise.b.std", "fix.z.p.std"])
    assert found["unidentified"] == ["noise.a.std and noise.b.std: only their sum"]
    assert [each["std_error"] is None for each in found["parameters"]] == [True, True, False]
    assert 0.15 < found["parameters"][2]["new"] < 0.25
    a, b = (each["new"] for each in found["parameters"][:2])
    assert 0.4 < np.hypot(a, b) < 0.6


def test_outliers_do_not_count(tied):
    spec = load(tied)
    log = simulate(spec, 800, 2)
    columns = {name: column.copy() for name, column in log.columns.items()}
    columns["fix.p"][::40] += 50.0
    columns["bias.k"][::50] -= 8.0
    free = ["fix.z.p.std", "bias.z.k.std"]
    plain, robust = (tune(spec, replace(log, columns=columns), free, robust=each) for each in (False, True))
    std = [[each["new"] for each in found["parameters"]] for found in (plain, robust)]
    assert all(0.15 < each[0] < 0.27 for each in std)  # gated
    assert std[0][1] > 0.5  # has no gate
    assert 0.08 < std[1][1] < 0.4 * std[0][1]


def test_starts_formulas_and_truth(tied):
    spec = load(tied)
    log = simulate(spec, 300, 3)
    found = tune(spec, log, ["states.k.init", "dynamics.f.p", "measurements.bias.z.k.h"], holdout=0)
    k, decay, gain = (each["new"] for each in found["parameters"])
    assert abs(decay - 0.95) < 4 * found["parameters"][1]["std_error"]
    assert found["parameters"][0]["old"] == 2
    assert found["unidentified"] == ["states.k.init and measurements.bias.z.k.h: only a combination of them"]
    assert abs(gain * k - np.nanmean(log.columns["bias.k"])) < 0.1
    assert found["log_likelihood"]["holdout_before"] is None
    found = tune(spec, log, ["noise.a.std"], objective="rmse")
    assert found["parameters"][0]["std_error"] is None
    assert 0.05 < found["parameters"][0]["new"] < 2
    bare = replace(log, columns={n: c for n, c in log.columns.items() if not n.startswith("true.")})
    with pytest.raises(KfgenError, match="has a column true"):
        tune(spec, bare, ["noise.a.std"], objective="rmse")


@pytest.mark.parametrize(
    ("paths", "said"),
    [
        (["noise.c.std"], "no number at `noise.c.std`; did you mean `noise.b.std`"),
        (["std"], "may be"),
        (["noise.a.std", "a.std"], "named twice"),
        (["dt"], "code is generated for the number itself"),
        (["fix.gate.probability"], "code is generated for the number itself"),
        (["states.k.std"], "changes nothing"),
    ],
)
def test_refuses(tied, paths, said):
    spec = load(tied)
    log = simulate(spec, 20)
    columns = {**log.columns, "bias.k": np.full(20, np.nan)}
    with pytest.raises(KfgenError, match=said):
        tuned(spec, [replace(log, columns=columns)], paths)


def test_writes_the_numbers_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = WRONG.replace("\n", "\r\n").replace("value: 3,", "value: 3 ,") + "# the end"
    (tmp_path / "wrong.yaml").write_bytes(text.encode())
    truth = loads(TRUE)
    log = simulate(truth, 200, 1)
    from kfgen.logs import write

    write(tmp_path / "log.csv", log.columns)
    result = CliRunner().invoke(cli, ["tune", "wrong.yaml", "log.csv", "-o", "new.yaml", "--json"])
    assert result.exit_code == 0, result.output
    plain = json.loads(result.stdout)
    new = (tmp_path / "new.yaml").read_bytes().decode()
    restored = new
    for each in plain["parameters"]:
        assert restored.count(spelled(each["new"])) == 1
        restored = restored.replace(spelled(each["new"]), spelled(each["old"]))
    assert restored == text
    again = load("new.yaml")
    assert [slot.value for slot in default_slots(again)] == [each["new"] for each in plain["parameters"]]
    told = CliRunner().invoke(cli, ["tune", "wrong.yaml", "log.csv", "--free", "walk,drive"]).output
    assert "std error" in told
    assert "held out" in told
    assert CliRunner().invoke(cli, ["tune", "wrong.yaml", "log.csv", "-o", "wrong.yaml"]).exit_code == 2


def test_ctrl_c_leaves_what_was_found(judge):
    spec, slots, objective = judge
    calls = []

    def advance(done, what):
        calls.append(done)
        if len(calls) == 6:
            signal.default_int_handler(signal.SIGINT, None)

    found = searched(spec, slots, objective.over([simulate(loads(TRUE), 200, 1)]), advance)
    assert found.interrupted
    assert found.curvature is None
    assert found.after.likelihood[0] > found.before.likelihood[0]
    assert found.as_json()["parameters"][0]["std_error"] is None


CROSSED = """
kfgen: 1
name: crossed
constants: {r: &shared 0.09}
dt: 0.1
states: {p: {init: 0, std: 1}, v: {init: 0, std: "1.0"}}
dynamics:
  form: discrete
  f: {p: "p
     + dt*v", v: 0.9*v}
  Q: [[0.02, 0.01], [1e-2, .04]]   # symmetric
measurements:
  fix:
    z: {p: {h: p}, v: {h: v}}
    R: [[r, "0.02*1.0"], [0.02, *shared]]
filter: {type: kf}
"""


def test_both_entries_of_a_matrix_change(tmp_path):
    path = tmp_path / "crossed.yaml"
    path.write_text(CROSSED)
    spec = load(path)
    log = simulate(loads(CROSSED.replace("0.01], [1e-2", "-0.015], [-0.015")), 1500, 1)
    found = tuned(spec, [log], ["Q[0][1]", "dynamics.Q.1.1", "measurements.fix.R[0][1]"])
    assert abs(found.values[0] + 0.015) < 3 * found.curvature.errors[0]
    assert found.slots[0].positive is False
    (tmp_path / "crossed.yaml").write_text(CROSSED)
    new = loads(found.text()).dynamics.Q
    assert new[0][1].text == new[1][0].text == spelled(found.values[0])
    assert found.text().count(spelled(found.values[2])) == 2
    assert "   # symmetric" in found.text()
