from __future__ import annotations

import pytest

from kfgen.check import check, compare, tolerance_of
from kfgen.native import load_filters
from kfgen.reference import reference
from kfgen.spec import loads
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


FAR = """
kfgen: 1
name: far_origin
dt: 0.01
states: {x: {init: 4.2e6, std: 10}, v: {init: 15, std: 1}}
dynamics: {f: {x: x + dt*v}, Q: {x: 1e-6, v: 1e-4}}
measurements: {gnss: {z: {x: {h: x, std: 3}}}}
filter: {type: kf}
"""


def test_a_state_that_float_cannot_resolve_fails():
    """Half a unit in the last place at 4.2e6 is 0.25, a step 0.15: the comparison alone would pass."""
    outcome = check(loads(FAR))
    assert not outcome.passed
    assert [text.partition(":")[0] for text in outcome.coarse] == ["x"]
    assert "float resolves 4.2e+06 to 0.5" in outcome.coarse[0]
    assert "local origin" in outcome.coarse[0]
    for spec in (loads(FAR.replace("name: far", "scalar: double\nname: far")), loads(FAR.replace("4.2e6", "420"))):
        outcome = check(spec)
        assert outcome.passed
        assert outcome.coarse == ()
