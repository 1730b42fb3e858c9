"""specs/ins.yaml on simulated flights that begin 30 degrees off level and north, and what a plain ekf makes of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from flight import Flight, fly

import kfgen
from kfgen.spec.types import Filter
from tests.oracle.error_state import compose, inverse, log

RUNS = 12


@pytest.fixture(scope="module")
def flights():
    return [fly(seed, math.radians(30)) for seed in range(RUNS)]


def followed(kf, flight: Flight, taking=("gnss", "mag")):
    """The normalised error squared per degree of freedom, and the errors [rows, 15]; the statuses."""
    kf.init()
    nees, errors, statuses = [], [], []
    readings = iter([*flight.readings, (len(flight.truth), "", None)])
    row, sensor, z = next(readings)
    for k, (x, u) in enumerate(zip(flight.truth, flight.inputs, strict=True)):
        statuses.append(kf.predict(u))
        while row == k:
            statuses.append(kf.update(sensor, z, u if sensor in taking else None))
            row, sensor, z = next(readings)
        found = kf.x
        e = np.concatenate([x[:6] - found[:6], log(compose(inverse(found[6:10]), x[6:10])), x[10:] - found[10:]])
        errors.append(e)
        nees.append(e @ np.linalg.solve(kf.P, e) / 15)
    return np.array(nees), np.array(errors), np.array(statuses)


@pytest.fixture(scope="module")
def runs(build, flights):
    kf = build("ins")
    return [followed(kf, flight) for flight in flights]


def test_is_as_sure_as_it_may_be(runs):
    """The band of a mean of 12 runs with 15 degrees of freedom is 1 +- 3 sqrt(2 / 180) = 0.32."""
    nees = np.mean([run[0] for run in runs], axis=0)
    assert np.all(np.abs(nees[[0, 5, 20, 50, 100, 200, 400, 999]] - 1) < 0.32)
    assert abs(np.mean(nees) - 1) < 0.15


def test_no_call_fails(runs):
    assert all(np.all(run[2] == 0) for run in runs)


def test_knows_where_it_is(runs):
    rms = np.sqrt(np.mean([run[1][500:] ** 2 for run in runs], axis=(0, 1)))
    assert np.all(rms[:3] < 0.4)  # m, of fixes of 1 and 2 m; measured: 0.13 to 0.26
    assert np.all(rms[6:9] < math.radians(0.5))  # measured: 0.2 degrees
    assert np.all(rms[9:12] < 0.002)  # rad/s, of 0.01; measured: 0.001
    assert np.all(rms[12:] < 0.03)  # m/s^2, of 0.05; measured: 0.012 to 0.017


def begun_wrong(build, flights, chosen):
    """The NEES without `initialize`, from level and north."""
    spec = replace(build("ins").spec, initialize=(), filter=chosen)
    kf = kfgen.reference(spec)
    begun = [Flight(f.truth[:150], f.inputs[:150], [r for r in f.readings if r[0] < 150]) for f in flights]
    return np.mean([followed(kf, flight, ("gnss",))[0] for flight in begun], axis=0)


def test_the_plain_ekf_believes_too_much_from_there(build, flights):
    nees = begun_wrong(build, flights, Filter("ekf", "full", "joseph"))
    assert nees[0] > 3  # measured: 6.3
    assert nees[100] > 1.7  # measured: 3.0


def test_the_iterated_one_does_not(build, flights):
    nees = begun_wrong(build, flights, Filter("iekf", "full", "joseph", iterations=4))
    assert np.all(np.abs(nees[[0, 20, 50, 100, 149]] - 1) < 0.32)
