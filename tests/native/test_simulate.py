from __future__ import annotations

import numpy as np
import pytest

from kfgen.errors import KfgenError
from kfgen.logs import needed_columns
from kfgen.simulate import simulate
from kfgen.spec import loads


def test_the_same_seed_gives_the_same_log(spec):
    first, again, other = simulate(spec, 50, 1), simulate(spec, 50, 1), simulate(spec, 50, 2)
    for name, column in first.columns.items():
        np.testing.assert_array_equal(column, again.columns[name])
    assert any(not np.array_equal(column, other.columns[name]) for name, column in first.columns.items())


def test_columns_times_inputs_and_angles(spec):
    log = simulate(spec, 300)
    assert set(needed_columns(spec)) <= set(log.columns)
    t = log.columns["t"]
    assert t[0] == 0
    assert (np.abs(np.diff(t) - 0.1) <= 0.0101).all()
    assert len(set(np.diff(t))) > 10
    assert (np.abs(log.columns["gyro"]) <= 0.25).all()
    assert np.abs(log.columns["gyro"]).max() > 0.01
    assert (np.abs(log.columns["true.th"]) <= np.pi).all()
    assert (np.abs(log.columns["compass.heading"]) <= np.pi).all()


def test_a_filter_is_consistent_on_its_own_model(kf, spec):
    nees, nis = [], []
    for seed in range(20):
        log = simulate(spec, 100, seed)
        kf.init()
        result = kf.run(log)
        truth = np.column_stack([log.columns[f"true.{name}"] for name in kf.states])
        error = truth - result.x
        error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
        nees.append((error**2 / result.var).mean(axis=0))
        nis.append([result.nis["gnss"].mean() / 2, result.nis["compass"].mean()])
    np.testing.assert_allclose(np.mean(nees, axis=0), 1, atol=0.25)
    np.testing.assert_allclose(np.mean(nis, axis=0), 1, atol=0.1)


def test_rates_and_gaps(spec):
    log = simulate(spec, 200, every={"gnss": 5}, gaps=0.3)
    there = ~np.isnan(log.columns["gnss.x"])
    assert not there[np.arange(200) % 5 != 0].any()
    assert 0 < there.sum() < 40
    with pytest.raises(KfgenError, match="unknown sensor `gps`"):
        simulate(spec, every={"gps": 2})


DISCRETE = """
kfgen: 1
name: walk
dt: 0.5
states:
  a: {init: 1, std: 0}
  b: {init: 0, std: 1, bounds: [-0.5, 0.5]}
  c: {init: 0, std: 1}
covariances: [[b, c, 1]]
noise: {w: {std: 2}}
dynamics:
  f: {c: "c + a*w*w"}
measurements:
  s: {z: {m: {h: c + e1, std: 0}}, noise: {e1: {std: 0}}}
"""


def test_noise_goes_through_f_bounds_clip_and_zero_variances_stay():
    log = simulate(loads(DISCRETE), 400)
    assert (log.columns["true.a"] == 1).all()
    assert (np.abs(log.columns["true.b"]) <= 0.5).all()
    c = log.columns["true.c"]
    assert (np.diff(c) >= 0).all()  # w*w: an additive noise would go both ways
    assert np.diff(c).mean() == pytest.approx(4, rel=0.3)
    np.testing.assert_array_equal(log.columns["s.m"], c)
    np.testing.assert_array_equal(log.columns["t"][:3], [0.5, 1.0, 1.5])


CONTINUOUS = """
kfgen: 1
name: integrator
dt: 0.1
states: {p: {init: 0, std: 0}, v: {init: 0, std: 0}}
noise: {a: {density: 3}}
dynamics: {form: continuous, f: {p: v, v: a}, integrator: exact}
measurements: {s: {z: {p: {h: p, std: 1}}}}
"""


def test_a_density_is_integrated():
    spec = loads(CONTINUOUS)
    log = simulate(spec, 600)
    assert np.var(np.diff(log.columns["true.v"])) == pytest.approx(3.0 * 0.1, rel=0.2)  # density times dt


def test_a_model_that_explodes_is_told():
    text = DISCRETE.replace("c + a*w*w", "exp(c*c + 10)")
    with pytest.raises(KfgenError, match=r"walk: .*--seed"):
        simulate(loads(text), 100)


BANK = """
kfgen: 1
name: bank
dt: 1
states: {p: {init: 0, std: 0}, v: {init: 1, std: 0}}
measurements: {s: {z: {p: {h: p, std: 1}}}}
imm:
  modes:
    go: {dynamics: {f: {p: p + 1}}, filter: {type: kf}}
    stay: {dynamics: {f: {p: p}}, filter: {type: kf}}
  transition: [[0.9, 0.1], [0.2, 0.8]]
  mu0: [1, 0]
"""


def test_a_bank_switches_its_modes():
    p = simulate(loads(BANK), 600).columns["true.p"]
    moved = np.diff(p, prepend=0)
    assert set(moved) == {0, 1}
    assert moved[0] == 1  # mu0
    assert moved.mean() == pytest.approx(2 / 3, abs=0.1)  # the stationary share of `go`
    assert np.mean(moved[1:] != moved[:-1]) == pytest.approx(2 * 0.1 * 2 / 3, abs=0.05)
