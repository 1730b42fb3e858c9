from __future__ import annotations

import pytest

from kfgen.check import compare, tolerance_of
from kfgen.native import load_filters
from kfgen.reference import reference
from tests.native.small import vehicle_small


def test_a_right_filter_passes(kf, spec):
    outcome = compare(kf, reference(spec), 200)
    assert outcome.passed
    assert outcome.P.error < 1e-5
    assert not outcome.differences


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("0.64f", "0.65f"),  # a variance
        ("-dt * SPEED", "dt * SPEED"),  # a sign in the Jacobian
        ("nis > 100.0f", "nis > 1.0f"),  # a gate
        ("dt <= 0.0f", "dt <= 0.1f"),  # a guard
        ("kf->x[0] += dt * SPEED * cosf(kf->x[2]);\n", ""),
        ("kf->x[2] = wrap(kf->x[2] + dt * u->gyro)", "kf->x[2] += 0.0f / (kf->x[2] - kf->x[2])"),  # NaN
    ],
)
def test_a_wrong_filter_fails(spec, files, right, wrong):
    assert right in files["vehicle_small.c"]
    broken = {**files, "vehicle_small.c": files["vehicle_small.c"].replace(right, wrong)}
    outcome = compare(load_filters([vehicle_small(spec, broken)])[0], reference(spec), 100)
    assert not outcome.passed


def test_tolerances():
    assert tolerance_of("double") < tolerance_of("float") < tolerance_of("q16.16")
