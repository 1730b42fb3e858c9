"""What a step does beside the algebra: gates, masks, bounds, limits, errors, logs."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from problems import ALL, CV4, NOISE_INPUTS, RADAR, one_state
from scipy.stats import chi2

import kfgen.reference
from kfgen.reference import Status, reference
from kfgen.reference.model import Context, wrap
from kfgen.spec import loads


def build(text: str):
    return reference(loads(text))


def test_gate_is_strict_and_changes_nothing():
    kf = build(RADAR)
    assert kf.predict() == 0
    x, P, t = kf.x, kf.P, kf.t
    assert kf.update("radar", [500.0, 3.0]) == Status.GATED
    assert kf.nis > chi2.ppf(0.9999, 2)
    np.testing.assert_array_equal(kf.x, x)
    np.testing.assert_array_equal(kf.P, P)
    assert (kf.t, kf.gate_count["radar"]) == (t, 1)
    assert kf.update("radar", [float(np.hypot(*x[:2])), float(np.arctan2(x[1], x[0]))]) == 0
    assert kf.gate_count["radar"] == 0


def test_gate_reset():
    kf = build(NOISE_INPUTS)
    z = [kf.x[2] + 1.5]
    assert [kf.update("compass", z) for _ in range(4)] == [Status.GATED] * 3 + [Status.ANOMALY]
    assert kf.gate_count["compass"] == 0
    assert kf.x[2] > 3.0 or kf.x[2] < -1.5


def test_mask_and_run_time_R():
    kf = build(NOISE_INPUTS)
    x, P, u = kf.x, kf.P, [3.0, 0.0]
    R = np.array([[0.25, 0.1], [0.1, 0.25 + 0.01 * 9.0]])
    assert kf.update("gnss", [math.nan, math.nan], u, mask=0) == 0
    assert kf.update("gnss", [math.nan, 2.0], u, mask=0b10) == 0
    assert kf.x[1] == pytest.approx(2.0 * P[1, 1] / (P[1, 1] + R[1, 1]))
    assert kf.x[0] == x[0]
    kf.init()
    assert kf.update("gnss", [1.0, 2.0], u) == 0
    S = P[:2, :2] + R
    np.testing.assert_allclose(kf.x[:2], P[:2, :2] @ np.linalg.solve(S, [1.0, 2.0]), rtol=1e-12)
    assert kf.nis == pytest.approx(np.array([1.0, 2.0]) @ np.linalg.solve(S, [1.0, 2.0]))
    with pytest.raises(TypeError):
        kf.update("gnss", [1.0, 2.0])
    with pytest.raises(TypeError):
        kf.update("compass", [1.0], mask=1)


def test_bounds_and_angles():
    kf = build(NOISE_INPUTS)
    kf.set_state([0, 0, 3 * math.pi, 0.5])
    assert kf.x[2] == math.pi
    kf.predict([0.0, 0.0], 0.1)
    assert kf.x[3] == 0.2
    kf.set_state([0, 0, -math.pi, 0.0])
    assert kf.x[2] == math.pi
    assert wrap(2.0, 4.0) == 2.0
    assert wrap(-2.0, 4.0) == 2.0
    assert wrap(5.0, 4.0) == 1.0
    assert wrap(0.1, 4.0) == 0.1


def test_own_residual_may_use_the_names_of_states():
    """A state called h is hidden inside a residual, where h is the prediction."""
    text = one_state(
        "  form: discrete\n  f: {x: x}",
        z='{h: x + 2*h, var: 1, residual: "2*(z - h)"}',
        states="  h: {init: 3, var: 0}",
    )
    kf = build(text)
    assert kf.update("s", [8.0]) == 0  # prediction 7, residual 2
    assert kf.x[0] == pytest.approx(1.0 + 2.0 * 0.5 / 1.5)


def test_initialize():
    text = CV4.replace("dynamics:", "initialize: {from: gnss, states: {px: x, py: y}}\ndynamics:")
    kf = build(text)
    P = kf.P
    assert kf.update("gnss", [math.nan, 3.0]) == Status.NOT_FINITE
    assert kf.update("gnss", [-7.0, 3.0]) == 0
    np.testing.assert_array_equal(kf.x, [-7.0, 3.0, 10.0, 0.0])
    np.testing.assert_array_equal(kf.P, P)
    assert kf.update("gnss", [-6.0, 3.0]) == 0
    assert -7.0 < kf.x[0] < -6.9
    kf.init()
    assert kf.x[0] == 50.0
    assert kf.update("gnss", [1.0, 1.0]) == 0
    assert kf.x[0] == 1.0


def test_floor_and_ceiling():
    base = one_state("  form: discrete\n  f: {x: x + y}", states="  y: {init: 0, var: 2}")
    P = np.array([[2.5, 2.0], [2.0, 2.0]])
    for form in ("full", "ud", "sqrt"):  # the same numbers in every form
        for limit, expected in [
            ("variance_floor: 3", [[3.0, 2.0], [2.0, 3.0]]),
            ("variance_floor: {y: 3}", [[2.5, 2.0], [2.0, 3.0]]),
            ("variance_ceiling: {x: 1}", [[1.0, 2.0 / math.sqrt(2.5)], [2.0 / math.sqrt(2.5), 2.0]]),
            ("variance_ceiling: {y: 1}", [[2.5, math.sqrt(2.0)], [math.sqrt(2.0), 1.0]]),
            ("variance_floor: {x: 5}, variance_ceiling: {y: 0.5}", [[5.0, 1.0], [1.0, 0.5]]),
        ]:
            kf = build(base.replace("type: ekf", f"type: ekf, covariance: {form}, {limit}"))
            assert kf.predict() == Status.REGULARIZED
            np.testing.assert_allclose(kf.P, expected, rtol=1e-14)
    kf = build(base.replace("type: ekf", "type: ekf, variance_floor: 1e-9, variance_ceiling: 1e9"))
    assert kf.predict() == 0
    np.testing.assert_allclose(kf.P, P, rtol=1e-14)


def test_errors_leave_the_filter_as_it_was():
    text = one_state(
        "  form: discrete\n  f: {x: x/a}\n  Q: {x: q}",
        "parameters: {a: 1, q: 0, r: 1}",
        "{h: log(x), var: r}",
    )
    kf = build(text)

    def snapshot():
        return kf.x.tobytes(), kf.P.tobytes(), kf.t, kf.nis, kf.log_likelihood

    before = snapshot()
    kf.parameters["a"] = 0.0
    assert kf.predict() == Status.NOT_FINITE
    kf.parameters["a"], kf.parameters["q"] = 1.0, -1.0
    assert kf.predict() == Status.NOT_POSITIVE
    kf.parameters["q"] = math.nan
    assert kf.predict() == Status.NOT_FINITE
    kf.parameters["r"] = -0.1
    assert kf.update("s", [0.0]) == Status.NOT_POSITIVE
    assert kf.update("s", [math.nan]) == Status.NOT_FINITE
    assert kf.update("s", [math.inf]) == Status.NOT_FINITE
    assert kf.set_state([math.inf]) == Status.NOT_FINITE
    assert snapshot() == before
    kf.set_state([-1.0])
    before = snapshot()
    kf.parameters["r"] = 1.0
    assert kf.update("s", [0.0]) == Status.NOT_FINITE
    kf.parameters["r"], kf.parameters["a"] = -1.0, 0.0  # the first of the errors counts
    assert kf.update("s", [0.0]) == Status.NOT_FINITE
    kf.parameters["q"] = -1.0
    assert kf.predict() == Status.NOT_FINITE
    assert snapshot() == before
    with pytest.raises(KeyError):
        kf.parameters["unknown"] = 1.0


def test_run():
    kf = build(NOISE_INPUTS)
    nan = math.nan
    log = {
        "t": [10.0, 10.1, 10.1, 10.4, 10.4],
        "v": [1.0, 1.0, 1.0, 1.0, nan],
        "w": [0.0] * 5,
        "gnss.x": [0.1, nan, 0.2, nan, 0.0],
        "gnss.y": [0.1, nan, nan, nan, 0.0],
        "compass.heading": [nan, 3.0, nan, 3.0, nan],
    }
    result = kf.run(log)
    hand = build(NOISE_INPUTS)
    hand.update("gnss", [0.1, 0.1], [1.0, 0.0])
    np.testing.assert_array_equal(result.x[0], hand.x)
    assert result.nis["gnss"][0] == hand.nis
    hand.predict([1.0, 0.0], 10.1 - 10.0)
    hand.update("compass", [3.0])
    np.testing.assert_array_equal(result.x[1], hand.x)
    hand.update("gnss", [0.2, nan], [1.0, 0.0], mask=1)
    np.testing.assert_array_equal(result.x[2], hand.x)
    np.testing.assert_array_equal(result.var[2], hand.P.diagonal())
    hand.predict([1.0, 0.0], 10.4 - 10.1)
    hand.update("compass", [3.0])
    np.testing.assert_array_equal(result.x[3], hand.x)
    assert list(result.status) == [0, 0, 0, 0, Status.NOT_FINITE]
    assert np.array_equal(np.isnan(result.nis["gnss"]), [False, True, False, True, True])
    assert np.array_equal(np.isnan(result.nis["compass"]), [True, False, True, False, True])
    with pytest.raises(ValueError, match="no column v"):
        kf.run({"t": [0.0], "w": [0.0]})


def test_run_with_a_fixed_step_predicts_in_every_row():
    kf, hand = build(CV4), build(CV4)
    result = kf.run({"gnss.x": [51.0, math.nan, 53.0], "gnss.y": [0.0, math.nan, math.nan]})
    hand.predict()
    hand.update("gnss", [51.0, 0.0])
    hand.predict()
    hand.predict()  # the last row's vector is not whole, and the sensor is not `partial`
    np.testing.assert_array_equal(result.x[2], hand.x)
    np.testing.assert_array_equal(result.var[2], hand.P.diagonal())
    twice = build(CV4).run({"t": [0.1, 0.1, 0.2, 0.3], "gnss.x": [51.0, math.nan, math.nan, 53.0],
                            "gnss.y": [0.0, math.nan, math.nan, math.nan]})  # fmt: skip
    np.testing.assert_array_equal(twice.x[3], hand.x)


@pytest.mark.parametrize("name", ALL)
def test_problems_run_and_stay_consistent(name):
    """Every problem for 100 steps on measurements from its own prediction: finite, symmetric, nonnegative."""
    kf = build(ALL[name])
    rng = np.random.default_rng(3)
    u = np.full(len(kf.model.inputs), 0.2)
    run_time = kf.spec.dt.run_time
    for _ in range(100):
        assert kf.predict(u if len(u) else None, 0.1 if run_time else None) == 0
        for sensor in kf.sensors.values():
            now = Context(kf.parameters, u, kf.t, 0.0)
            still = [0.0] * len(sensor.spec.noise)
            predicted = [float(v) for v in sensor.predict(list(kf.x), still, now, range(sensor.m))]
            z = np.array(predicted) + 0.01 * rng.normal(size=sensor.m)
            assert kf.update(sensor.name, z, u) == 0
        assert np.array_equal(kf.P, kf.P.T)
        assert np.min(np.linalg.eigvalsh(kf.P)) > -1e-12 * np.max(kf.P)


def test_the_oracle_shares_nothing_with_the_generator():
    allowed = ("kfgen.errors", "kfgen.spec", "kfgen.reference")
    for path in Path(kfgen.reference.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                modules = [node.module or ""]
            for module in modules:
                assert not module.startswith("kfgen") or module.startswith(allowed), (path.name, module)
                assert not module.startswith("sympy")
