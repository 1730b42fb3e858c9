from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from kfgen.errors import KfgenError
from kfgen.native import load_filters
from kfgen.reference import reference
from kfgen.status import Status
from tests.native.small import vehicle_small


def test_starts_initialised(kf):
    np.testing.assert_array_equal(kf.x, [0, 0, 0.25])
    np.testing.assert_array_equal(kf.P, np.diag([1, 1, 0.25]))
    assert kf.nis == 0
    assert kf.x.dtype == np.float64


def test_agrees_with_the_reference(kf, spec):
    ref = reference(spec)
    for k in range(50):
        assert kf.predict(u=[0.3], dt=0.1) == ref.predict([0.3], 0.1) == 0
        assert kf.update("gnss", [0.5 * k, 0.1 * k]) == ref.update("gnss", [0.5 * k, 0.1 * k])
        assert kf.update("compass", [0.3]) == ref.update("compass", [0.3])
    np.testing.assert_allclose(kf.x, ref.x, rtol=1e-4)
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-4, atol=1e-6)
    assert kf.nis == pytest.approx(ref.nis, rel=1e-3)


def test_rows_by_name_are_rows_in_order(kf):
    other = kf.copy()
    kf.predict([0.2], 0.1)
    kf.update("gnss", [1, 2])
    other.predict({"gyro": 0.2}, 0.1)
    other.update("gnss", {"y": 2, "x": 1})
    assert bytes(kf) == bytes(other)


def test_errors_of_the_filter_are_statuses_and_change_nothing(kf):
    before = bytes(kf)
    assert kf.predict([math.nan], 0.1) == Status.NOT_FINITE
    assert kf.predict([1e300], 0.1) == Status.NOT_FINITE  # too large for a float
    assert kf.predict([0.1], -1) == Status.NOT_POSITIVE
    assert kf.update("gnss", [1, math.inf]) == Status.NOT_FINITE
    assert kf.set_state([0, 0, math.nan]) == Status.NOT_FINITE
    assert kf.set_covariance(np.diag([1, -1, 1])) == Status.NOT_POSITIVE
    assert bytes(kf) == before


def test_a_gated_vector(kf):
    assert kf.update("gnss", [1000, 0]) == Status.GATED
    assert kf.gate_count == {"gnss": 1}
    assert kf.nis > 100


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda kf: kf.predict(dt=0.1), TypeError, "u= is missing"),
        (lambda kf: kf.predict([0.1]), TypeError, "dt= is missing"),
        (lambda kf: kf.predict([0.1, 0.2], 0.1), ValueError, r"u \(gyro\) must have shape \(1,\)"),
        (lambda kf: kf.predict({"giro": 1}, 0.1), KeyError, "did you mean 'gyro'"),
        (lambda kf: kf.update("gps", [1, 2]), KeyError, "known: gnss, compass"),
        (lambda kf: kf.update("gnss", [1, 2, 3]), ValueError, r"\(x, y\) must have shape"),
        (lambda kf: kf.update("gnss", {"x": 1}), KeyError, "lacks y"),
        (lambda kf: kf.update("compass", [1], mask=1), TypeError, "partial"),
        (lambda kf: kf.update("gnss", [1, 2], mask=4), ValueError, "between 0 and 3"),
        (lambda kf: kf.update("gnss", [1, 2], mask=[True]), ValueError, "one entry per component"),
        (lambda kf: kf.set_state([1, 2]), ValueError, r"x must have shape \(3,\)"),
        (lambda kf: kf.set_covariance([1, 2, 3]), ValueError, r"P must have shape \(3, 3\)"),
        (lambda kf: kf.parameters["sigma"], KeyError, "did you mean 'sigma_v'"),
        (lambda kf: kf.log_likelihood, AttributeError, "no field log_likelihood"),
        (lambda kf: kf.mu, AttributeError, "no field mu"),
        (lambda kf: kf.modes, AttributeError, "no imm"),
        (lambda kf: kf.R, AttributeError, "adapt_R"),
        (lambda kf: kf.Q, AttributeError, "vehicle_small_get_Q"),
        (lambda kf: kf.redraw(), AttributeError, "vehicle_small_redraw"),
    ],
)
def test_wrong_calls_say_what_is_wrong(kf, call, error, text):
    with pytest.raises(error, match=text):
        call(kf)


def test_masks(kf):
    bits, flags, whole = kf.copy(), kf.copy(), kf.copy()
    assert bits.update("gnss", [1, math.nan], mask=1) == 0
    assert flags.update("gnss", [1, 77], mask=[True, False]) == 0
    assert bytes(bits) == bytes(flags)
    assert whole.update("gnss", [1, 77], mask=3) == Status.GATED
    before = bytes(kf)
    assert kf.update("gnss", [1, 2], mask=0) == 0
    assert bytes(kf) == before


def test_parameters_are_the_filters(kf):
    assert dict(kf.parameters) == {"sigma_v": 0.5}
    still = kf.copy()
    kf.parameters["sigma_v"] = 5
    kf.predict([0], 0.1)
    still.predict([0], 0.1)
    assert kf.P[0, 0] - still.P[0, 0] == pytest.approx(0.1 * (25 - 0.25), rel=1e-5)
    kf.init()
    assert kf.parameters["sigma_v"] == 0.5
    with pytest.raises(TypeError):
        del kf.parameters["sigma_v"]


def test_copies_are_independent(kf):
    for duplicate in (kf.copy(), copy.copy(kf), copy.deepcopy(kf)):
        before = bytes(kf)
        duplicate.predict([0.1], 0.1)
        assert bytes(kf) == before != bytes(duplicate)


def test_set_state_wraps_and_set_covariance_reads_the_upper_triangle(kf):
    assert kf.set_state([1, 2, 4]) == 0
    np.testing.assert_allclose(kf.x, [1, 2, 4 - 2 * math.pi], rtol=1e-6)
    assert kf.set_covariance([[2, 0.5, 0], [99, 3, 0], [99, 99, 1]]) == 0
    np.testing.assert_array_equal(kf.P, [[2, 0.5, 0], [0.5, 3, 0], [0, 0, 1]])


def test_raw_is_the_struct(kf):
    raw = kf.raw
    assert list(raw) == ["x", "P", "parameters", "nis", "gate_count_gnss"]
    assert raw["x"].dtype == np.float32
    assert raw["parameters"] == {"sigma_v": 0.5}
    raw["x"][:] = 7  # a copy
    assert kf.x[0] == 0


def test_many_in_one_library(spec):
    from dataclasses import replace

    filters = [vehicle_small(spec), vehicle_small(replace(spec, name="twin"))]
    first, second = load_filters(filters, flags=["-O0"])
    first.predict([0.1], 0.1)
    assert second.name == "twin"
    assert second.predict([0.1], 0.1) == 0
    np.testing.assert_array_equal(first.x, second.x)
    with pytest.raises(KfgenError, match="two filters"):
        load_filters([filters[0], filters[0]])
    assert load_filters([]) == []


def test_a_layout_that_is_not_as_declared_is_refused(spec, files):
    # a member that only the C compiler sees
    name = "vehicle_small.h"
    sly = files[name].replace("vehicle_small_real_t nis;", "vehicle_small_real_t nis, more;")
    with pytest.raises(KfgenError, match="bytes in C"):
        load_filters([vehicle_small(spec, {**files, name: sly})])
