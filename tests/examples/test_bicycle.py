"""specs/bicycle.yaml over the track of a bicycle seen by a lidar and a radar, whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import kfgen
from kfgen.native.trace import trace
from kfgen.tuning import tuned


def filters(build):
    """As it is, and as an ekf."""
    ukf = build("bicycle")
    options = replace(ukf.spec.filter, type="ekf", update="bierman", sigma_points=None)
    return {"ukf": ukf, "ekf": kfgen.compile(replace(ukf.spec, filter=options))}


@pytest.mark.parametrize("kind", ["ukf", "ekf"])
def test_it_is_as_sure_as_it_may_be(build, recorded, kind):
    kf = filters(build)[kind]
    log = recorded(kf, "lidar_radar")
    course = trace(kf, log)
    last = course.last()
    error = course.x[last, :2] - np.column_stack([log.columns["true.x"], log.columns["true.y"]])
    P = course.P[last][:, :2, :2]
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(P), error) / 2
    assert 0.8 < nees.mean() < 1.25  # measured: 1.01, 1.01
    assert (np.sqrt((error[5:] ** 2).mean(axis=0)) < 0.12).all()  # measured: 0.07, 0.09
    assert np.mean(course.status >= 0x100) == 0


def test_tuning_finds_the_noises_that_stand_in_it(build, recorded):
    kf = build("bicycle")
    log = recorded(kf, "lidar_radar")
    found = tuned(kf.spec, [log], ["w_speed.root_density", "w_turn.root_density"])
    assert found.curvature is not None
    assert (np.abs(np.subtract(found.values, [0.12, 0.11])) < found.curvature.errors).all()  # measured: 0.115, 0.111
