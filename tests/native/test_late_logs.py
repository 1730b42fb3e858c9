"""Late measurements in logs: columns that say how late, runs that take them at their time, logs drawn so."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kfgen
from kfgen.cli import cli
from kfgen.errors import KfgenError
from kfgen.late import ages, delayed, made_at
from kfgen.logs import Log
from kfgen.native.run import fixed_step, plan
from kfgen.simulate import simulate
from kfgen.spec import loads

CART = """kfgen: 1
name: cart
dt: 0.1
states: {p: {init: 0, std: 1, unit: m}, v: {init: 0, std: 1, unit: m/s}}
dynamics: {form: discrete, f: {p: p + dt*v}, Q: {v: 0.01}}
measurements:
  wheel: {z: {v: {h: v, std: 0.1, unit: m/s}}}
  fix: {z: {x: {h: p, std: 0.3, unit: m}}}
filter: {type: kf}
history: {steps: 8, keep: 3}
"""
LOOSE = CART.replace("dt: 0.1", "dt: {nominal: 0.1}").replace("name: cart", "name: loose")


@pytest.fixture(scope="module")
def filters():
    fixed, loose = (kfgen.compile(loads(text), history=True) for text in (CART, LOOSE))
    return {"cart": fixed, "loose": loose, "plain": kfgen.compile(loads(CART))}


@pytest.mark.parametrize("name", ["cart", "loose"])
def test_a_delayed_log_gives_what_the_log_in_time_gives(filters, name):
    kf = filters[name]
    log = simulate(kf.spec, 120, seed=3, every={"fix": 3})
    late = delayed(kf.spec, log, {"fix": 0.25})
    kf.init()
    in_time = kf.run(log)
    kf.init()
    found = kf.run(late)
    steps = found.age["fix"][~np.isnan(found.nis["fix"])]
    assert set(steps) <= {2, 3}
    assert found.late()["fix"] == (len(steps), pytest.approx(steps.mean()), 3)
    # between two fixes that have both arrived all is known that is known in time
    settled = np.flatnonzero(~np.isnan(late.columns["fix.x"]))[5:]
    for row in settled:
        made = row - int(found.age["fix"][row])
        if not np.isfinite(log.columns["fix.x"][made + 1 : row + 1]).any():
            np.testing.assert_array_equal(found.x[row], in_time.x[row])
            np.testing.assert_array_equal(found.var[row], in_time.var[row])
    # and the nis is that of the measurement at its time
    np.testing.assert_array_equal(found.nis["fix"][settled], in_time.nis["fix"][settled - found.age["fix"][settled]])
    assert np.abs(found.x - in_time.x).max() > 1e-3


def test_the_run_is_the_calls(filters):
    kf = filters["cart"]
    log = delayed(kf.spec, simulate(kf.spec, 60, seed=1, every={"fix": 2}), {"fix": 0.3, "wheel": 0.1})
    kf.init()
    result = kf.run(log)
    kf.init()
    for row in range(60):
        kf.predict()
        for sensor in ("wheel", "fix"):
            z = log.columns[f"{sensor}.{kf.sensors[sensor][0]}"][row]
            if not np.isnan(z):
                assert kf.update(sensor, [z], age=int(result.age[sensor][row])) == result.calls[f"update_{sensor}"][row]
        np.testing.assert_array_equal(kf.x, result.x[row])


def test_ages_are_counted_to_the_nearest_step():
    spec = loads(CART)
    t = np.array([0.1, 0.2, 0.3, 0.3, 0.4, 0.5])
    step = np.array([1, 1, 1, 0, 1, 1], dtype=np.uint8)
    log = Log({"t": t, "fix.time": np.array([0.1, 0.04, 0.16, np.nan, 0.05, 0.9])}, 6)
    # 0.04 is nearest to the start, at 0; 0.05 is between it and the first step: the later; 0.9 is not yet there
    assert ages(spec, log, t, step)[:, 1].tolist() == [0, 2, 1, 0, 3, 0]
    assert made_at(spec, log, t)["fix"][3] == 0.3
    both = Log({"t": t, "fix.time": t, "fix.age": t}, 6)
    with pytest.raises(KfgenError, match=r"`fix` has both `\.age` and `\.time`"):
        ages(spec, both, t, step)


def test_what_is_too_old_is_told():
    spec = loads(CART)
    kf = kfgen.compile(spec, history=True)
    log = simulate(spec, 40, seed=1)
    columns = {**log.columns, "fix.age": np.where(np.arange(40) % 4 == 0, 0.9, np.nan)}
    result = kf.run(columns)
    # after 8 steps none is kept; before that the filter had not begun
    assert (result.calls["update_fix"][::4] == 0x800).all()
    assert np.isnan(result.nis["fix"][::4]).all()
    assert "TOO_OLD" in {flag.name for flag in result.counts()["update_fix"]}


def test_a_component_called_age_is_a_component():
    spec = loads(CART.replace("{x: {h: p", "{age: {h: p"))
    log = simulate(spec, 5)
    assert not ages(spec, log, log.columns["t"], np.ones(5, dtype=np.uint8)).any()
    with pytest.raises(KfgenError, match="has a component `age`"):
        delayed(spec, log, {"fix": 0.1})


def test_a_plain_filter_has_no_ages(filters):
    kf = filters["plain"]
    log = delayed(kf.spec, simulate(kf.spec, 20), {"fix": 0.2})
    result = kf.run(log)
    assert result.age == {}
    assert plan(loads(CART.replace("history: {steps: 8, keep: 3}", "")), log, fixed_step(kf.spec)).age.max() == 0


def test_on_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(CART)

    def kfgen_(*arguments):
        result = CliRunner().invoke(cli, list(arguments), prog_name="kfgen")
        assert "Traceback" not in result.output
        return result

    call = ["simulate", "cart.yaml", "-o", "log.csv", "--steps", "100", "--every", "fix=5", "--delay", "fix=0.2"]
    assert kfgen_(*call).exit_code == 0
    with Path("log.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    late = [row for row in rows if row["fix.x"]]
    assert [float(row["fix.age"]) for row in late] == pytest.approx([0.2] * len(late))
    assert all(bool(row["fix.x"]) == bool(row["fix.age"]) for row in rows)
    result = kfgen_("run", "cart.yaml", "log.csv", "-o", "out.csv")
    assert result.exit_code == 0
    assert "fix: 20 late measurements, 3 predictions repeated for each on average, at most 2" in result.stderr
    for wrong, text in (("fxi=1", "unknown sensor `fxi`"), ("fix=-1", "not possible"), ("fix", "is not SENSOR=S")):
        refused = kfgen_("simulate", "cart.yaml", "-o", "no.csv", "--delay", wrong)
        assert refused.exit_code == 2
        assert text in refused.output
    assert not Path("no.csv").exists()
