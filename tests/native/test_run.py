from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kfgen.errors import KfgenError
from kfgen.logs import Log
from kfgen.native import run as running
from kfgen.native.run import plan
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import Status

NAN = float("nan")


def log_of(**columns):
    rows = len(next(iter(columns.values())))
    blank = {
        "t": np.arange(rows) * 0.1,
        "gyro": np.zeros(rows),
        "gnss.x": np.full(rows, NAN),
        "gnss.y": np.full(rows, NAN),
        "compass.heading": np.full(rows, NAN),
    }
    return blank | {name.replace("__", "."): np.array(column, float) for name, column in columns.items()}


def test_a_run_is_the_calls_one_by_one(kf, spec):
    log = simulate(spec, 200, seed=3, every={"gnss": 3, "compass": 2}, gaps=0.1)
    result = kf.copy().run(log)
    t = log.columns["t"]
    for k in range(log.rows):
        if k > 0:
            kf.predict([log.columns["gyro"][k]], t[k] - t[k - 1])
        for sensor, components in kf.sensors.items():
            z = [log.columns[f"{sensor}.{component}"][k] for component in components]
            if not np.isnan(z).any():
                kf.update(sensor, z)
                assert result.nis[sensor][k] == kf.nis
            else:
                assert np.isnan(result.nis[sensor][k])
        np.testing.assert_array_equal(result.x[k], kf.x)
        np.testing.assert_array_equal(result.var[k], kf.P.diagonal())


def test_a_run_is_the_references(kf, spec):
    log = simulate(spec, 200, every={"gnss": 4}, gaps=0.2)
    ours, theirs = kf.run(log), reference(spec).run(log.columns)
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-3)
    np.testing.assert_allclose(ours.var, theirs.var, rtol=1e-3)
    np.testing.assert_array_equal(np.isnan(ours.nis["gnss"]), np.isnan(theirs.nis["gnss"]))


def test_no_step_in_the_first_row_and_for_equal_times(kf):
    result = kf.run(log_of(t=[5, 5, 5.1]))
    np.testing.assert_array_equal(result.x[0], result.x[1])
    assert result.x[2, 0] > 0


def test_errors_are_counted_and_not_fatal(kf):
    result = kf.run(log_of(t=[0, 0.1, 0.05, 0.2], gnss__x=[0, 0, np.inf, 500], gnss__y=[0, 0, 0, 0]))
    assert result.counts() == {
        "predict": {Status.NOT_POSITIVE: 1},
        "update_gnss": {Status.NOT_FINITE: 1},
    }
    assert result.counts(errors=False) == {"update_gnss": {Status.GATED: 1}}
    assert result.status[2] == Status.NOT_POSITIVE | Status.NOT_FINITE
    assert np.isnan(result.nis["gnss"][2])
    assert result.nis["gnss"][3] > 100
    assert np.isfinite(result.x).all()


def test_a_half_filled_row_is_masked_for_a_partial_sensor(kf, spec):
    half = log_of(gnss__x=[1, 1], gnss__y=[NAN, 1])
    result = kf.copy().run(half)
    kf.update("gnss", [1, NAN], mask=1)
    np.testing.assert_array_equal(result.x[0], kf.x)
    masks = plan(spec, Log(half, 2)).mask
    np.testing.assert_array_equal(masks[:, 0], [1, 3])


def test_a_half_filled_row_is_no_measurement_otherwise(spec):
    whole = replace(spec, measurements=(replace(spec.measurements[0], partial=False), spec.measurements[1]))
    np.testing.assert_array_equal(
        plan(whole, Log(log_of(gnss__x=[1, 1], gnss__y=[NAN, 1]), 2)).mask[:, 0], [0, 3]
    )


def test_an_empty_input_keeps_its_value(kf, spec):
    np.testing.assert_array_equal(plan(spec, Log(log_of(gyro=[1, NAN, NAN, 2]), 4)).u[:, 0], [1, 1, 1, 2])
    with pytest.raises(KfgenError, match=r"input `gyro` is empty in the first row"):
        kf.run(log_of(gyro=[NAN, 1]))


def test_a_sensor_may_be_missing_as_a_whole_in_memory_only(kf):
    log = log_of(t=[0, 1])
    del log["compass.heading"]
    assert np.isnan(kf.run(log).nis["compass"]).all()
    del log["gnss.x"]
    with pytest.raises(KfgenError, match=r"column `gnss\.x` is missing"):
        kf.run(log)


def test_long_logs_go_in_chunks(kf, spec, monkeypatch):
    log = simulate(spec, 50)
    whole = kf.copy().run(log)
    monkeypatch.setattr(running, "CHUNK", 7)
    seen = []
    pieces = kf.run(log, lambda done, rows: seen.append((done, rows)))
    np.testing.assert_array_equal(whole.x, pieces.x)
    assert seen[0] == (7, 50)
    assert seen[-1] == (50, 50)


FIXED = """
kfgen: 1
name: drift
dt: 0.1
states: {x: {init: 0, std: 1}}
dynamics: {Q: {x: 1}}
measurements: {s: {z: {x: {h: x, std: 1}}}}
"""


def test_a_fixed_step_predicts_in_every_row():
    work = plan(loads(FIXED), Log({"s.x": np.array([1, NAN, 2])}, 3), 0.1)
    np.testing.assert_array_equal(work.step, [1, 1, 1])
    np.testing.assert_allclose(work.t, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(work.mask[:, 0], [1, 0, 1])
    own = plan(loads(FIXED), Log({"t": np.array([7.0, 7, 9]), "s.x": np.ones(3)}, 3), 0.1)
    np.testing.assert_array_equal(own.t, [7, 7, 9])
    np.testing.assert_array_equal(own.step, [1, 0, 1])  # one instant, two rows
    timeless = plan(loads(FIXED.replace("dt: 0.1\n", "")), Log({"t": np.array([7.0, 7, 9]), "s.x": np.ones(3)}, 3))
    np.testing.assert_array_equal(timeless.step, [1, 1, 1])
