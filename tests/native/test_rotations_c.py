"""The compiled filters of rotations against the reference, call by call."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import kfgen
from kfgen.spec.types import Adaptive, Code, Filter, Gate, Robust
from tests.oracle import inertial
from tests.oracle.attitude import ERRORS, expression, star, turning
from tests.oracle.error_state import compose, exp
from tests.oracle.formulas import quaternion
from tests.oracle.test_rotation_options import bank

Q = quaternion("q")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
BOTH = pytest.mark.parametrize("error", ["body", "reference"])
ALL_FORMS = [("ud", "bierman"), ("ud", "joseph"), ("full", "joseph"), ("full", "standard"), ("sqrt", None)]


def along(spec, calls, tolerance=1e-9, scalar="double"):
    """Both filters take the same calls."""
    kf, ref = kfgen.compile(spec, scalar=scalar), kfgen.reference(spec)
    for number, (name, *arguments) in enumerate(calls):
        status, expected = (getattr(each, name)(*arguments) for each in (kf, ref))
        assert status == expected, (number, name, arguments)
        sigma = np.sqrt(np.maximum(np.diag(ref.P), 1e-12))
        assert np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)) < tolerance, (number, name)
        assert np.max(np.abs(kf.x - ref.x)) < tolerance * max(1.0, float(np.max(np.abs(ref.x)))), (number, name)
        if name == "update":
            assert kf.nis == pytest.approx(ref.nis, rel=1e-6, abs=1e-9)
    return kf, ref


def inertial_calls(rows, sensors=("gnss", "mag")):
    for u, z, _ in inertial.readings(rows):
        yield "predict", u
        for name in sensors:
            if name in z:
                yield "update", name, z[name]


@BOTH
@pytest.mark.parametrize("reset", [True, False])
def test_ekf(error, reset):
    along(inertial.spec(error, reset), inertial_calls(400))


@pytest.mark.parametrize(("covariance", "update"), ALL_FORMS)
@pytest.mark.parametrize("unroll", ["auto", "none"])
def test_forms(covariance, update, unroll):
    chosen = Filter("ekf", covariance, update)
    spec = inertial.spec(chosen=chosen, star="body", code=Code(unroll=unroll))
    along(spec, inertial_calls(60, ("gnss", "mag", "star")))


@pytest.mark.parametrize("unroll", ["auto", "none"])
@pytest.mark.parametrize(("covariance", "update"), ALL_FORMS[::2])
def test_iekf(covariance, update, unroll):
    chosen = Filter("iekf", covariance, update, iterations=3)
    spec = inertial.spec("reference", chosen=chosen, star="reference", code=Code(unroll=unroll))
    along(spec, inertial_calls(60, ("gnss", "mag", "star")))


@BOTH
@pytest.mark.parametrize("covariance", ["ud", "full", "sqrt"])
@pytest.mark.parametrize("redraw", [True, False])
def test_ukf(error, covariance, redraw):
    sensors = ("gnss",) if not redraw else ("gnss", "mag", "star")
    spec = inertial.spec(error, chosen=inertial.ukf(covariance, redraw), star=error)
    spec = replace(spec, measurements=tuple(s for s in spec.measurements if s.name in sensors))
    along(spec, inertial_calls(30, sensors), 1e-7)


@pytest.mark.parametrize("options", [
    {"covariance": "ud", "sequential": True}, {"augment": True}, {"adaptive": Adaptive(expression(0.5))},
    {"adapt_R": expression(0.01)}, {"reject": "non_finite"}, {"variance_floor": {"q_rx": expression(1e-4)}},
], ids=lambda o: "+".join(o))  # fmt: skip
@pytest.mark.parametrize("unroll", ["auto", "none"])
def test_ukf_options(options, unroll):
    chosen = inertial.ukf(**{"covariance": "full", **options})
    spec = inertial.spec(chosen=chosen, star="body", code=Code(unroll=unroll))
    along(spec, inertial_calls(16, ("gnss", "mag", "star")), 1e-7)


def tracker(error="body", chosen=None, seen="body", **changes):
    """A star tracker on a body."""
    given = {"f": dict(zip(ERRORS, GYRO, strict=True)), "inputs": GYRO, "chosen": chosen, "Q": {"q_rx": 0.01}}
    sensors = (star(Q, np.array([0.05, 0.1, 0.2]), seen),)
    return turning(np.array([0.8, 0.6, 0.0, 0.0]), (0.2, 0.1, 0.3), error, **({"sensors": sensors} | given | changes))


def tracker_calls(rows=25):
    random, q = np.random.default_rng(2), np.array([0.8, 0.6, 0.0, 0.0])
    for k in range(rows):
        u = 2 * random.standard_normal(3)
        q = compose(q, exp(0.1 * u))
        yield "predict", u
        yield "update", "star", compose(q, exp(0.1 * random.standard_normal(3))) * (1 + k % 3) * (-1) ** k


FULL = [
    {}, {"robust": Robust("huber", expression(1.5))}, {"adaptive": Adaptive(chi2=expression(0.5))},
    {"adapt_R": expression(0.1)}, {"adapt_Q": expression(0.1)}, {"consider": ("q_rz",)},
    {"gain_limit": expression(0.5)}, {"innovation_floor": expression(0.02)},
    {"variance_floor": {"q_rx": expression(0.01)}, "variance_ceiling": {"q_rz": expression(0.05)}},
]  # fmt: skip


@pytest.mark.parametrize("options", FULL, ids=lambda o: "+".join(o) or "plain")
@pytest.mark.parametrize(("error", "covariance"), [("body", "full"), ("reference", "ud")])
def test_options(options, error, covariance):
    along(tracker(error, Filter("ekf", covariance, "joseph", **options), seen=error), tracker_calls())


@BOTH
def test_gates_and_masks(error):
    spec = tracker(error, seen="reference")
    (seen,) = spec.measurements
    spec = replace(spec, measurements=(replace(seen, gate=Gate(expression(0.9)), partial=True),))
    kf, _ = along(spec, tracker_calls())
    before = bytes(kf)
    assert kf.update("star", [1, 0, 0, 0], mask=0b0111) == 0
    assert np.array_equal(np.frombuffer(before), np.frombuffer(bytes(kf))) or kf.nis == 0
    assert kf.update("star", [0, 0, 0, 0]) == kfgen.Status.NOT_POSITIVE


@BOTH
@pytest.mark.parametrize("kind", ["ekf", "iekf", "ukf"])
def test_any_start(error, kind):
    """Nearly 180 degrees off, q and -q, no rate, a norm far from 1: as the reference has it. At 180 degrees the sign of
    the innovation is that of a rounding: finite, and the measurement is believed."""
    chosen = {"ekf": Filter("ekf", "ud", "bierman"), "iekf": Filter("iekf", "ud", "bierman", iterations=4),
              "ukf": inertial.ukf("ud")}[kind]  # fmt: skip
    calls = []
    for start in ([1e-3, 1, 0, 0], [1, 0, 0, 0], [-1, 0, 0, 0], [1, 0, 3, 4], [1e-3, 0, 0, -1], [1e17, 0, 0, 1e20]):
        calls += [("set_state", start), ("predict", [0, 0, 0]), ("update", "star", [1, 0, 0, 0]),
                  ("update", "star", [-1, 0, 0, 0]), ("predict", [3, 0, 0])]  # fmt: skip
    calls += [("set_state", [0, 9.9e-4, 0, 0]), ("set_state", [0, 0, 0, 0])]
    kf, _ = along(tracker(error, chosen, error), calls, 1e-7)
    for start in ([0, 1, 0, 0], [0, 0, 0.6, 0.8]):
        assert kf.set_state(start) == kf.set_covariance(np.eye(3)) == 0
        for _ in range(20):
            assert kf.update("star", [1, 0, 0, 0]) == 0
        assert abs(kf.x[0]) > 0.99
        assert np.isfinite(kf.P).all()


BANKS = [
    (Filter("ekf", "full", "joseph"), Filter("ekf", "full", "joseph")),
    (Filter("ekf", "ud", "bierman"), Filter("iekf", "ud", "bierman", iterations=2)),
    (inertial.ukf("ud"), Filter("ekf", "full", "standard")),
    (inertial.ukf("sqrt"), Filter("ekf", "sqrt", None)),
]  # fmt: skip


@BOTH
@pytest.mark.parametrize("filters", BANKS, ids=lambda f: "+".join(f"{each.type}-{each.covariance}" for each in f))
@pytest.mark.parametrize("unroll", ["auto", "none"])
def test_imm(error, filters, unroll):
    spec = bank(error)
    modes = tuple(replace(mode, filter=chosen) for mode, chosen in zip(spec.imm.modes, filters, strict=True))
    spec = replace(spec, imm=replace(spec.imm, modes=modes), code=Code(unroll=unroll))
    along(spec, tracker_calls(30), 1e-7)


def test_a_million_float_steps_keep_the_norm():
    kf = kfgen.compile(tracker(chosen=Filter("ekf", "ud", "bierman")), scalar="float")
    rows = 1_000_000
    t = 0.1 * np.arange(rows)
    log = {"gyro_x": np.sin(t), "gyro_y": 3 * np.cos(0.7 * t), "gyro_z": np.full(rows, 0.3)}
    result = kf.run(log)
    assert np.max(np.abs(np.linalg.norm(result.x, axis=1) - 1)) < 1e-6
    assert np.all(result.var > 0)
    assert not result.status.any()
