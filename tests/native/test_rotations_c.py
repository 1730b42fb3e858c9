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
from tests.oracle.formulas import formula, quaternion
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


INERTIAL = [
    ("body", True, Filter("ekf", "ud", "bierman"), ("gnss", "mag"), 400),
    ("reference", False, Filter("ekf", "full", "standard"), ("gnss", "mag"), 400),
    ("reference", True, Filter("ekf", "sqrt", None), ("gnss", "mag", "star"), 100),
    ("body", True, Filter("iekf", "full", "joseph", iterations=3), ("gnss", "mag", "star"), 60),
    ("body", True, inertial.ukf("ud"), ("gnss", "mag", "star"), 30),
    ("reference", True, inertial.ukf("full", redraw=False), ("mag",), 30),
]  # fmt: skip


@pytest.mark.parametrize(("error", "reset", "chosen", "sensors", "rows"), [
    INERTIAL[0], *(pytest.param(*each, marks=pytest.mark.long) for each in INERTIAL[1:]),
])  # fmt: skip
def test_inertial(error, reset, chosen, sensors, rows):
    """15 errors, 6 noises, tumbling at 3 rad/s."""
    spec = inertial.spec(error, reset, chosen, star=error)
    spec = replace(spec, measurements=tuple(s for s in spec.measurements if s.name in sensors))
    along(spec, inertial_calls(rows, sensors), 1e-7 if chosen.type == "ukf" else 1e-9)


@pytest.mark.long
@pytest.mark.parametrize("covariance", ["ud", "full", "sqrt"])
def test_inertial_in_loops(covariance):
    updates = {"ud": "bierman", "full": "standard", "sqrt": None}
    chosen = Filter("ekf", covariance, updates[covariance])
    along(inertial.spec(chosen=chosen, code=Code(unroll="none")), inertial_calls(60))


KINDS = [
    *(Filter("ekf", covariance, update) for covariance, update in ALL_FORMS),
    *(Filter("iekf", covariance, update, iterations=3) for covariance, update in ALL_FORMS[::2]),
    *(inertial.ukf(covariance, redraw) for covariance in ("ud", "full", "sqrt") for redraw in (True, False)),
    inertial.ukf("ud", sequential=True), inertial.ukf("full", augment=True),
    inertial.ukf("full", adaptive=Adaptive(expression(0.5))), inertial.ukf("ud", adapt_R=expression(0.01)),
    inertial.ukf("sqrt", reject="non_finite"), inertial.ukf("full", variance_floor={"q_rx": expression(0.01)}),
]  # fmt: skip


@pytest.mark.parametrize("chosen", KINDS, ids=range(len(KINDS)))
@pytest.mark.parametrize(("error", "unroll"), [("body", "auto"), ("reference", "none")])
def test_kinds_and_forms(chosen, error, unroll):
    """An attitude with a bias of one axis."""
    rates = dict(zip(ERRORS, [formula(name) for name in GYRO], strict=True))
    rates |= {"q_rx": formula("gyro_x") - formula("b") - formula("w")}
    spec = tracker(error, chosen, seen="reference", f=rates, beside={"b": (0.0, 0.1)}, noise={"w": 1e-4},
                   code=Code(unroll=unroll))  # fmt: skip
    along(spec, tracker_calls(16), 1e-7 if chosen.type == "ukf" else 1e-9)


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
