"""Exact sensors, exact states, repeated sensors: cases with closed answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import SIX_SENSORS

from kfgen.reference import Status, reference
from kfgen.reference.joseph import batch, sequential, update
from kfgen.reference.linalg import lower_root, udu
from kfgen.reference.status import StepError
from kfgen.spec import loads


def two_states(var: str = "4", r1: str = "0", r2: str = "1", h2: str = "b") -> str:
    return f"""
kfgen: 1
name: two
scalar: double
dt: 1
states:
  a: {{init: 0, var: {var}}}
  b: {{init: 0, var: {var}}}
dynamics:
  form: discrete
  f: {{a: a + b}}
measurements:
  s:
    z:
      z1: {{h: a, var: {r1}}}
      z2: {{h: "{h2}", var: {r2}}}
filter: {{type: kf}}
"""


def test_six_identical_sensors():
    kf = reference(loads(SIX_SENSORS))
    assert kf.update("level", [10.0] * 6) == 0
    assert kf.x[0] == pytest.approx(10.0, abs=1e-4)
    assert kf.P[0, 0] == pytest.approx(1.0 / (6.0 + 1e-6), rel=1e-9)
    # y^T S^-1 y with S = 1e6 1 1^T + I is 600 / (1 + 6e6)
    assert kf.nis == pytest.approx(600.0 / (1.0 + 6e6), rel=1e-6)


def test_six_exact_sensors_count_once():
    kf = reference(loads(SIX_SENSORS.replace("var: 1}", "var: 0}")))
    assert kf.update("level", [10.0] * 6) == 0
    assert kf.x[0] == 10.0
    assert kf.P[0, 0] == 0.0
    assert kf.nis == pytest.approx(1e-4)
    # now x is known exactly: whatever an exact sensor says, there is nothing to correct and no nis
    assert kf.update("level", [11.0] * 6) == 0
    assert kf.x[0] == 10.0
    assert kf.nis == 0.0
    assert kf.log_likelihood == 0.0


def test_exact_sensor_on_an_awkward_scale_stays_exact():
    """0.3*x measured exactly leaves a rounding error of P, which must not become a gain."""
    text = SIX_SENSORS.replace("var: 1}", "var: 0}").replace("h: x,", "h: 0.3*x,").replace("1e6", "7.7")
    kf = reference(loads(text))
    assert kf.update("level", [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]) == 0
    assert kf.x[0] == pytest.approx(10.0, rel=1e-15)
    assert kf.P[0, 0] == 0.0
    assert kf.nis == pytest.approx(9.0 / (0.09 * 7.7))


def test_zero_prior_ignores_measurements():
    kf = reference(loads(two_states(var="0", r1="1")))
    assert kf.update("s", [5.0, 6.0]) == 0
    np.testing.assert_array_equal(kf.x, [0.0, 0.0])
    np.testing.assert_array_equal(kf.P, np.zeros((2, 2)))
    assert kf.nis == pytest.approx(25.0 + 36.0)
    assert kf.predict() == 0
    np.testing.assert_array_equal(kf.P, np.zeros((2, 2)))


def test_one_exact_component():
    kf = reference(loads(two_states()))
    assert kf.update("s", [3.0, 5.0]) == 0
    np.testing.assert_allclose(kf.x, [3.0, 4.0], rtol=1e-15)
    np.testing.assert_allclose(kf.P, [[0.0, 0.0], [0.0, 0.8]], rtol=1e-14)
    assert kf.nis == pytest.approx(9.0 / 4.0 + 25.0 / 5.0)
    assert kf.log_likelihood == pytest.approx(
        -0.5 * (2 * math.log(2 * math.pi) + kf.nis + math.log(4.0) + math.log(5.0))
    )


def test_contradicting_exact_components_the_first_wins():
    kf = reference(loads(two_states(r2="0", h2="2*a")))
    assert kf.update("s", [3.0, 100.0]) == 0
    np.testing.assert_array_equal(kf.x, [3.0, 0.0])
    np.testing.assert_array_equal(kf.P, [[0.0, 0.0], [0.0, 4.0]])
    assert kf.nis == pytest.approx(9.0 / 4.0)


def test_exact_sum_leaves_the_difference():
    kf = reference(loads(two_states(r2="0", r1="1e30", h2="a + b")))
    assert kf.update("s", [0.0, 2.0]) == 0
    np.testing.assert_allclose(kf.x, [1.0, 1.0], rtol=1e-14)
    np.testing.assert_allclose(kf.P, [[2.0, -2.0], [-2.0, 2.0]], rtol=1e-14)
    for _ in range(50):  # again and again: the sum is known
        assert kf.update("s", [0.0, 2.0]) == 0
    np.testing.assert_allclose(kf.x, [1.0, 1.0], rtol=1e-13)
    np.testing.assert_allclose(kf.P, [[2.0, -2.0], [-2.0, 2.0]], rtol=1e-12)


def test_singular_full_R():
    """R = [[1, 1], [1, 1]]: the difference of the components is exact."""
    text = two_states(h2="b").replace(", var: 0}", "}").replace(", var: 1}", "}")
    text = text.replace("filter:", "    R: [[1, 1], [1, 1]]\nfilter:")
    kf = reference(loads(text))
    assert kf.update("s", [3.0, 1.0]) == 0
    H, P, R = np.eye(2), 4.0 * np.eye(2), np.ones((2, 2))
    S = P + R
    np.testing.assert_allclose(kf.x, P @ np.linalg.solve(S, [3.0, 1.0]), rtol=1e-13)
    np.testing.assert_allclose(kf.P, P - P @ H.T @ np.linalg.solve(S, H @ P), rtol=1e-13)
    assert kf.x[0] - kf.x[1] == pytest.approx(2.0, rel=1e-14)
    assert kf.nis == pytest.approx(np.array([3.0, 1.0]) @ np.linalg.solve(S, [3.0, 1.0]))


@pytest.mark.parametrize("seed", range(20))
def test_sequence_equals_batch(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 8), rng.integers(1, 6)
    root, noise = rng.normal(size=(n, n)), rng.normal(size=(m, m))
    P, R = root @ root.T, noise @ noise.T + 0.1 * np.eye(m)
    H, y = rng.normal(size=(m, n)), rng.normal(size=m)
    one, other, chosen = batch(P, H, R, y), sequential(P, H, R, y), update(P, H, R, y)
    for result in (other, chosen):
        np.testing.assert_allclose(result.dx, one.dx, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(result.P, one.P, rtol=1e-9, atol=1e-11)
        assert result.nis == pytest.approx(one.nis, rel=1e-10)
        assert result.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-10)


@pytest.mark.parametrize("rank", range(1, 6))
def test_factors_of_semidefinite_matrices(rank):
    rng = np.random.default_rng(rank)
    root = rng.normal(size=(5, rank))
    P = root @ root.T
    U, D = udu(P)
    np.testing.assert_allclose((U * D) @ U.T, P, atol=1e-12)
    assert np.count_nonzero(D > 1e-9) == rank
    S = lower_root(P)
    np.testing.assert_allclose(S @ S.T, P, atol=1e-12)


@pytest.mark.parametrize("P", [[[1.0, 2.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]], [[1.0, 0.5], [0.5, 0.0]]])
@pytest.mark.parametrize("computed", [False, True])
def test_indefinite(P, computed):
    with pytest.raises(StepError) as error:
        udu(np.array(P), computed=computed)
    assert error.value.status == Status.NOT_POSITIVE
    kf = reference(loads(two_states()))
    before = kf.P
    assert kf.set_covariance(P) == Status.NOT_POSITIVE
    np.testing.assert_array_equal(kf.P, before)


def test_set_covariance():
    kf = reference(loads(two_states()))
    assert kf.set_covariance([[4.0, 1.0], [99.0, 2.0]]) == 0  # only the upper triangle is read
    np.testing.assert_array_equal(kf.P, [[4.0, 1.0], [1.0, 2.0]])
    assert kf.set_covariance([[1.0, 1.0], [1.0, 1.0 - 2e-16]]) == 0  # indefinite by rounding only
    np.testing.assert_allclose(kf.P, np.ones((2, 2)), atol=1e-15)
    assert kf.set_covariance([[math.nan, 0.0], [0.0, 1.0]]) == Status.NOT_FINITE
    assert kf.set_covariance(np.zeros((2, 2))) == 0
    assert not kf.P.any()
