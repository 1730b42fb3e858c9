"""covariance: sqrt gives the numbers of the other forms, and its factor can be read and set."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import ALL, SIX_SENSORS, one_state

from kfgen.reference import Status, reference
from kfgen.spec import loads


def build(text: str):
    return reference(loads(text))


@pytest.mark.parametrize("name", ["vehicle4", "radar", "noise_inputs", "six_sensors"])
@pytest.mark.parametrize("kind", ["ekf", "iekf, iterations: 3", "ekf2"])
def test_the_same_numbers(name, kind):
    text = ALL[name].replace("type: kf", "type: ekf")
    root, ud = (build(text.replace("type: ekf", f"type: {kind}, covariance: {form}")) for form in ("sqrt", "ud"))
    rng = np.random.default_rng(5)
    u = np.full(len(ud.model.inputs), 0.2)
    for _ in range(10):
        for kf in (root, ud):
            assert kf.predict(u, 0.1 if kf.spec.dt.run_time else None) == 0
        for sensor in ud.sensors.values():
            z = rng.normal(size=sensor.m)
            assert root.update(sensor.name, z, u) == ud.update(sensor.name, z, u)
        np.testing.assert_array_equal(root.x, ud.x)
        np.testing.assert_array_equal(root.P, ud.P)
        S = root.sqrt_covariance
        np.testing.assert_array_equal(S, np.tril(S))
        np.testing.assert_allclose(S @ S.T, root.P, rtol=1e-9, atol=1e-12)
        assert np.all(S.diagonal() >= 0)
    with pytest.raises(AttributeError):
        _ = ud.sqrt_covariance
    with pytest.raises(AttributeError):
        ud.set_sqrt_covariance(np.eye(ud.model.n))


def two(options: str = ""):
    text = one_state("  form: discrete\n  f: {x: x + y}", states="  y: {init: 0, var: 2}")
    return build(text.replace("{type: ekf}", f"{{type: ekf, covariance: sqrt{options}}}"))


def test_set_sqrt_covariance():
    kf = two()
    np.testing.assert_allclose(kf.sqrt_covariance, np.diag(np.sqrt([0.5, 2.0])))
    assert kf.set_sqrt_covariance([[2.0, math.nan], [1.0, 3.0]]) == 0  # the upper triangle is not read
    np.testing.assert_array_equal(kf.P, [[4.0, 2.0], [2.0, 10.0]])
    np.testing.assert_allclose(kf.sqrt_covariance, [[2.0, 0.0], [1.0, 3.0]], rtol=1e-15)
    assert kf.set_sqrt_covariance([[-2.0, 0.0], [1.0, -3.0]]) == 0  # signs of columns do not matter
    np.testing.assert_array_equal(kf.P, [[4.0, -2.0], [-2.0, 10.0]])
    np.testing.assert_allclose(kf.sqrt_covariance, [[2.0, 0.0], [-1.0, 3.0]], rtol=1e-15)
    before = kf.x.tobytes(), kf.P.tobytes()
    for bad in (math.nan, math.inf, -math.inf):
        assert kf.set_sqrt_covariance([[1.0, 0.0], [bad, 1.0]]) == Status.NOT_FINITE
    assert (kf.x.tobytes(), kf.P.tobytes()) == before
    assert kf.set_sqrt_covariance(np.zeros((2, 2))) == 0
    assert not kf.P.any()
    assert not kf.sqrt_covariance.any()
    with pytest.raises(ValueError, match="reshape"):
        kf.set_sqrt_covariance([1.0, 2.0])


def test_semidefinite():
    kf = two()
    assert kf.set_sqrt_covariance([[0.0, 0.0], [0.0, 3.0]]) == 0
    assert kf.update("s", [5.0]) == 0  # x is known
    np.testing.assert_array_equal(kf.x, [1.0, 0.0])
    assert kf.predict() == 0
    np.testing.assert_allclose(kf.P, [[9.0, 9.0], [9.0, 9.0]], rtol=1e-15)
    np.testing.assert_allclose(kf.sqrt_covariance, [[3.0, 0.0], [3.0, 0.0]], rtol=1e-12, atol=1e-7)
    six = build(SIX_SENSORS.replace("type: kf", "type: kf, covariance: sqrt").replace("var: 1}", "var: 0}"))
    assert six.update("level", [10.0] * 6) == 0
    assert (six.x[0], six.P[0, 0], six.sqrt_covariance[0, 0]) == (10.0, 0.0, 0.0)


def test_limits_act_on_the_variances():
    kf = two(", variance_floor: {y: 1}, variance_ceiling: {x: 2}")
    assert kf.set_covariance([[2.5, 2.0], [2.0, 2.0]]) == 0
    kf.set_covariance([[8.0, 4.0], [4.0, 2.0]])
    x = kf.x
    assert kf.predict() == Status.REGULARIZED
    # [[18, 6], [6, 2]], of rank 1: no variance is below the floor, row and column of x are divided by 3
    np.testing.assert_allclose(kf.P, [[2.0, 2.0], [2.0, 2.0]], rtol=1e-7)
    np.testing.assert_array_equal(kf.x, [x[0] + x[1], x[1]])
