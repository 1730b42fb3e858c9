"""What must hold of filters of rotations, whatever the numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import kfgen
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process
from kfgen.simulate import simulate
from kfgen.spec.types import Filter
from tests.oracle import inertial
from tests.oracle.attitude import ERRORS, PARTS, expression, sensor, star, turning
from tests.oracle.error_state import Space, compose, exp, inverse, log, matrix
from tests.oracle.formulas import F, formula, product, quaternion, turned_by, unrotate, vector

Q = quaternion("q")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
RATES = dict(zip(ERRORS, GYRO, strict=True))
BOTH = pytest.mark.parametrize("error", ["body", "reference"])
FILTERS = {
    "ekf": Filter("ekf", "full", "joseph"),
    "iekf": Filter("iekf", "full", "joseph", iterations=3),
    "ukf": inertial.ukf("full"),
    "kept": inertial.ukf("ud", redraw=False),
    "sequential": inertial.ukf("ud", sequential=True),
}
EACH = pytest.mark.parametrize("kind", FILTERS)


def attitude(chosen=None, **changes):
    """Gyro as input, a direction and a star tracker as readings."""
    up = dict(zip("xyz", unrotate(Q, [0, 0, 1]), strict=True))
    given = {"init": (1, 0, 0, 0), "std": (0.3, 0.3, 0.3), "f": RATES, "inputs": GYRO, "chosen": chosen,
             "Q": dict.fromkeys(ERRORS, 1e-4),
             "sensors": (sensor("up", up, (1e-4,) * 3), star(Q, (0.02, 0.02, 0.05)))}  # fmt: skip
    return turning(**(given | changes))


def run(kf, rows=40, sign=1.0):
    """Rates and readings of a tumbling body, whose attitude is given with a sign."""
    q, random = np.array([0.8, 0.6, 0.0, 0.0]), np.random.default_rng(2)
    status = 0
    for k in range(rows):
        u = np.array([2.0, math.sin(0.1 * k), -1.0])
        q = compose(q, exp(0.1 * u))
        status |= kf.predict(u)
        turn = exp(0.02 * random.standard_normal(3))
        status |= kf.update("star", sign ** (k % 3) * compose(q, turn))
        status |= kf.update("up", matrix(q).T @ [0, 0, 1])
        yield q, status


@EACH
@BOTH
def test_q_and_minus_q_give_the_same_filter(kind, error):
    one, other = (kfgen.reference(attitude(FILTERS[kind], init=init, error=error))
                  for init in ((1, 0.2, 0, 0), (-1, -0.2, 0, 0)))  # fmt: skip
    for (q, status), (_, also) in zip(run(one), run(other, sign=-1.0), strict=True):  # noqa: B007
        assert status == also == 0
        assert np.allclose(matrix(one.x), matrix(other.x), rtol=0, atol=1e-13)
        assert np.allclose(one.P, other.P, rtol=0, atol=1e-15)
        assert one.nis == pytest.approx(other.nis, rel=1e-10)
    assert np.linalg.norm(log(compose(inverse(q), one.x))) < 0.05


@EACH
@BOTH
def test_body_and_reference_error_know_the_same_attitude(kind, error):
    """To first order in what they do not know: here little."""
    kf = kfgen.reference(attitude(FILTERS[kind], error=error, std=(1e-4,) * 3, Q=dict.fromkeys(ERRORS, 1e-10)))
    other = kfgen.reference(attitude(FILTERS["ekf"], std=(1e-4,) * 3, Q=dict.fromkeys(ERRORS, 1e-10)))
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for k in range(20):
        u = np.array([2.0, math.sin(0.1 * k), -1.0])
        q = compose(q, exp(0.1 * u))
        for each in (kf, other):
            assert each.predict(u) == 0
            assert each.update("star", compose(q, exp([1e-4, 0, -1e-4]))) == 0
        R = matrix(q) if error == "reference" else np.eye(3)
        assert np.allclose(matrix(kf.x), matrix(other.x), rtol=0, atol=1e-8)
        assert np.allclose(R.T @ kf.P @ R, other.P, rtol=0, atol=1e-3 * other.P.max())


@EACH
@BOTH
def test_half_a_turn_is_no_end(kind, error):
    """First readings from 180 degrees off, exactly and nearly; a residual of half a turn about any axis."""
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0, 0.8]):
        for turn in (math.pi, math.pi - 1e-9, math.pi + 1e-9):
            kf = kfgen.reference(attitude(FILTERS[kind], error=error, std=(2.0,) * 3))
            q = exp(turn * np.array(axis))
            assert kf.predict([0, 0, 0]) == 0
            for _ in range(3):
                assert kf.update("star", q) == 0
                assert kf.update("up", matrix(q).T @ [0, 0, 1]) == 0
            assert np.isfinite(kf.P).all()
            assert np.linalg.norm(kf.x) == pytest.approx(1.0, abs=1e-15)
            assert np.linalg.eigvalsh(kf.P)[0] > 0
            assert np.linalg.norm(log(compose(inverse(q), kf.x))) < 0.2


@EACH
@BOTH
def test_with_one_axis_it_is_the_filter_of_the_angle(kind, error):
    """Where the two other axes are known a first-order filter is that of the angle exactly, and the others to second
    order in what is not known."""
    for size in (0.2, 0.1):
        h = dict(zip("xy", unrotate(Q, [1, 0, 0])[:2], strict=True))
        kf = kfgen.reference(attitude(FILTERS[kind], error=error, std=(0, 0, size), Q={},
                                      sensors=(sensor("north", h, (0.01, 0.01)),)))  # fmt: skip
        angle, variance = 0.0, size**2
        for _ in range(10):
            kf.predict([0, 0, 0.7])
            angle += 0.07
            z = np.array([math.cos(angle + size), -math.sin(angle + size)])
            kf.update("north", z)
            H = np.array([[-math.sin(angle)], [-math.cos(angle)]])
            S = H * variance @ H.T + 0.01 * np.eye(2)
            K = variance * H.T @ np.linalg.inv(S)
            angle += float((K @ (z - [math.cos(angle), -math.sin(angle)]))[0])
            variance -= float((K @ S @ K.T)[0, 0])
            near = 1e-12 if kind == "ekf" else size**2
            assert np.allclose(kf.x, exp([0, 0, angle]), rtol=0, atol=near * size)
            assert kf.P[2, 2] == pytest.approx(variance, rel=10 * near)
            assert np.count_nonzero(kf.P) == 1


def simulated(spec, T, steps, x=None):
    """The state after T seconds in so many steps."""
    spec = replace(spec, dt=replace(spec.dt, nominal=expression(T / steps)))
    model = Model(spec)
    process, x = Process(model), model.x0 if x is None else x
    for k in range(steps):
        x = process.advance(x, np.zeros(len(spec.noise)), Context({}, np.zeros(len(model.inputs)), k * T / steps,
                                                                   T / steps))  # fmt: skip
    return x


def tumbling(integrator="rk4", **changes):
    """Euler's equations of a rigid body with moments of inertia 1, 2, 3."""
    w = vector("w")
    f = dict(zip(ERRORS, w, strict=True))
    f |= {"w_x": -(w[1] * w[2]), "w_y": w[2] * w[0], "w_z": F(formula(-1 / 3).tree) * w[0] * w[1]}
    beside = {"w_x": (1.0, 0.1), "w_y": (2.0, 0.1), "w_z": (0.5, 0.1)}
    return turning((1, 0.1, 0, 0.2), (0.1,) * 3, beside=beside, f=f, integrator=integrator, **changes)


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4)])
def test_integrators_converge_on_a_rigid_body(integrator, order):
    exact = simulated(tumbling(), 2.0, 4000)
    errors = [np.max(np.abs(simulated(tumbling(integrator), 2.0, steps) - exact)) for steps in (40, 80, 160)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.allclose(orders, order, atol=0.25)
    # angular momentum in the reference, and the energy, stay
    w, moments = exact[4:], np.array([1.0, 2.0, 3.0])
    first = Model(tumbling()).x0
    assert np.allclose(matrix(exact[:4]) @ (moments * w), matrix(first[:4]) @ (moments * first[4:]), atol=1e-9)
    assert np.linalg.norm(exact[:4]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("integrator", ["euler", "midpoint", "rk4", "exact"])
def test_a_constant_rate_is_exact(integrator):
    rate = np.array([2.0, -1.0, 0.5])
    spec = turning((1, 0, 0, 0), (0.1,) * 3, f=dict(zip(ERRORS, map(float, rate), strict=True)), integrator=integrator)
    assert np.allclose(simulated(spec, 0.7, 1), exp(0.7 * rate), rtol=0, atol=1e-15)
    spec = replace(spec, dynamics=replace(spec.dynamics, substeps=3 if integrator != "exact" else 1))
    assert np.allclose(simulated(spec, 0.7, 2), exp(0.7 * rate), rtol=0, atol=1e-15)


@BOTH
def test_exact_is_what_rk4_comes_to(error):
    """A platform with a constant bias and a lag; noises per step and densities."""
    f = {name: formula(g) - formula(b) - formula(w) for name, g, b, w in
         zip(ERRORS, (1.0, -2.0, 0.5), vector("b"), ("wx", "wy", "wz"), strict=True)}  # fmt: skip
    f |= {"s": -formula("s") * 0.7 + formula("r") + formula("n"), "r": formula(0.2) - formula("s")}
    beside = dict.fromkeys(("b_x", "b_y", "b_z", "s", "r"), (0.1, 0.2))
    noise = {"wx": 0.01, "wy": (0.02, True), "wz": (0.03, True), "n": (0.1, True)}
    spec = turning((1, 0.3, 0, 0), (0.1, 0.2, 0.3), error, beside=beside, f=f, noise=noise, integrator="exact")
    one = kfgen.reference(spec)
    rough = replace(spec, dynamics=replace(spec.dynamics, integrator="rk4", substeps=50))

    def silent(spec, density):
        return replace(spec, noise=tuple(replace(n, variance=expression(0)) if n.density == density else n
                                         for n in spec.noise))  # fmt: skip

    def stepped(spec, steps=1):
        kf = kfgen.reference(spec)
        for _ in range(steps):
            assert kf.predict() == 0
        return kf

    small = replace(silent(rough, False), dt=replace(spec.dt, nominal=expression(1e-4)))
    white = stepped(small, 1000)
    one.predict()
    assert np.allclose(one.x, white.x, rtol=0, atol=1e-12)
    # noises held over the step, through the integrator; and densities, which rk4 adds up at the step's start
    assert np.allclose(stepped(silent(spec, True)).P, stepped(silent(rough, True)).P, rtol=0, atol=1e-9)
    assert np.allclose(stepped(silent(spec, False)).P, white.P, rtol=0, atol=1e-5)


def test_discrete_and_continuous_form_agree():
    gyro = [formula(g) for g in GYRO]
    after = product(Q, turned_by([g * 0.1 for g in gyro]))
    one = kfgen.reference(attitude(form="discrete", f=dict(zip(PARTS, after, strict=True))))
    other = kfgen.reference(attitude())
    for _ in zip(run(one), run(other), strict=True):
        assert np.allclose(one.x, other.x, rtol=0, atol=1e-13)
        assert np.allclose(one.P, other.P, rtol=0, atol=1e-14)


def test_a_quaternion_without_dynamics_stays():
    kf = kfgen.reference(turning((0, 1, 0, 0), (0.1, 0.2, 0.3), form="discrete", Q={"q_rz": 0.5}))
    assert kf.predict() == 0
    assert np.array_equal(kf.x, [0, 1, 0, 0])
    assert np.allclose(kf.P, np.diag([0.01, 0.04, 0.59]), rtol=1e-12)


@pytest.mark.parametrize("kind", [kind for kind in FILTERS if kind != "kept"])  # kept points lack Q
@BOTH
def test_what_is_simulated_is_what_the_filter_expects(kind, error):
    """Errors are drawn where they live: NEES and NIS of every filter are about 1 per degree of freedom."""
    spec = attitude(FILTERS[kind], error=error, std=(0.2, 0.02, 0.3), Q={"q_rx": 1e-3, "q_rz": 1e-5})
    kf, nees, nis = kfgen.reference(spec), [], []
    for seed in range(12):
        log = simulate(spec, 25, seed=seed).columns
        kf.init()
        for k in range(25):
            assert kf.predict([log[name][k] for name in GYRO]) == 0
            assert kf.update("star", [log[f"star.{name}"][k] for name in PARTS]) == 0
            nis.append(kf.nis)
            e = Space(4, (0,), error).minus(np.array([log[f"true.{name}"][k] for name in PARTS]), kf.x)
            nees.append(e @ np.linalg.solve(kf.P, e))
    assert np.mean(nis) == pytest.approx(3.0, abs=0.5)
    assert np.mean(nees) == pytest.approx(3.0, abs=0.8)
