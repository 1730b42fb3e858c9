"""specs/px4.yaml on logs drawn from its own model: as sure as it may be, and what tells it the wind."""

from __future__ import annotations

import numpy as np
import pytest

import kfgen
from kfgen.simulate import simulate

RUNS = 8
EVERY = {"gnss": 20, "baro": 5, "mag": 5, "airspeed": 10, "sideslip": 10, "flow": 10}


@pytest.fixture(scope="module")
def kf(build):
    return build("px4")


@pytest.fixture(scope="module")
def logs(kf):
    return [simulate(kf.spec, 200, seed=seed, every=EVERY).columns for seed in range(RUNS)]


def end(kf, columns, without=()):
    """The error [23] and the covariance after a log, some sensors left out; the statuses."""
    kf.init()
    result = kf.run({name: column for name, column in columns.items() if name.split(".")[0] not in without})
    truth = np.array([columns[f"true.{name}"][-1] for name in kf.states])
    return kfgen.reference(kf.spec).model.space.difference(truth, kf.x), kf.P, result


def test_is_as_sure_as_it_may_be(kf, logs):
    """8 runs of 23 degrees of freedom: the band is 1 +- 3 sqrt(2 / 184)."""
    found = [end(kf, columns) for columns in logs]
    nees = np.mean([e @ np.linalg.solve(P, e) / 23 for e, P, _ in found])
    assert abs(nees - 1) < 0.31  # measured: 0.89
    assert not any(result.counts(errors=True) for _, _, result in found)


def test_airspeed_and_sideslip_tell_the_wind(kf, logs):
    wind = slice(0, 2)
    known, blind = (np.sqrt(np.diag(end(kf, logs[0], w)[1])[wind]) for w in ((), ("airspeed", "sideslip")))
    assert np.all(known < 1)  # m/s, of 2
    assert np.all(blind > 1.95)
