"""Options of filters of rotations: they act on the three errors of a quaternion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import kfgen
from kfgen.reference.status import Status
from kfgen.spec.types import Adaptive, Filter, Gate, Imm, Mode, Robust
from tests.oracle import inertial
from tests.oracle.attitude import ERRORS, expression, sensor, star, turning
from tests.oracle.error_state import (
    ErrorState,
    Space,
    cholesky,
    compose,
    exp,
    left_jacobian,
    log,
    matrix,
    right_jacobian,
)
from tests.oracle.formulas import formula, product, quaternion, unrotate

Q = quaternion("q")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
RATES = dict(zip(ERRORS, GYRO, strict=True))
BOTH = pytest.mark.parametrize("error", ["body", "reference"])
STD = (0.2, 0.1, 0.3)
SEEN = np.array([0.05, 0.1, 0.2])
START = np.array([0.8, 0.6, 0.0, 0.0])
TURN = np.array([0.1, -0.2, 0.3])


def tracker(error="body", chosen=None, seen="body", sensors=None, **changes):
    """A star tracker on a body."""
    given = {"f": RATES, "inputs": GYRO, "sensors": sensors or (star(Q, SEEN, seen),), "chosen": chosen}
    return turning(START, STD, error, **(given | changes))


def full(**options):
    return Filter("ekf", "full", "joseph", **options)


def off(error, d=TURN):
    """The attitude that is off by d."""
    return compose(START, exp(d)) if error == "body" else compose(exp(d), START)


def scalars(P, H, R, y, treat=lambda nu, s, r, c: (nu, 1.0, 1.0)):
    """Component by component; treat: nu, s, r, c -> nu, weight, inflation."""
    d = np.zeros(len(P))
    for h, r, innovation in zip(H, np.diag(R), y, strict=True):
        c = h @ P @ h
        nu, g, a = treat(innovation - h @ d, r + c, r, c)
        P, c = a * P, a * c
        K = P @ h / (r + g * c)
        P = P - g * np.outer(K, h @ P)
        d = d + K * nu
    return d, P


@BOTH
def test_gate_has_three_degrees_of_freedom(error):
    """chi2(0.99, 3) = 11.3449."""
    S = np.array(STD[0] ** 2 + SEEN[0] ** 2)
    for share, status in ((0.999, Status.OK), (1.001, Status.GATED)):
        gated = tracker(error, seen=error)
        gated = replace(gated, measurements=(replace(gated.measurements[0], gate=Gate(expression(0.99))),))
        kf = kfgen.reference(gated)
        before = kf.x
        assert kf.update("star", off(error, [math.sqrt(11.344867 * share * S), 0, 0])) == status
        assert kf.nis == pytest.approx(11.344867 * share, rel=1e-9)
        assert np.array_equal(kf.x, before) == (status == Status.GATED)


@BOTH
def test_robust(error):
    kf = kfgen.reference(tracker(error, full(robust=Robust("huber", expression(1.5))), error))
    assert kf.update("star", off(error)) == Status.GLITCH_LARGE

    def treat(nu, s, r, c):
        e = nu / math.sqrt(r)
        return math.sqrt(r) * min(max(e, -1.5), 1.5), float(abs(e) <= 1.5), 1.0

    d, P = scalars(np.diag(np.square(STD)), np.eye(3), np.diag(SEEN**2), TURN, treat)
    T = right_jacobian(d) if error == "body" else left_jacobian(d)
    assert np.allclose(kf.x, off(error, d), rtol=0, atol=1e-14)
    assert np.allclose(kf.P, T @ P @ T.T, rtol=0, atol=1e-15)


def test_adaptive():
    kf = kfgen.reference(tracker(chosen=full(adaptive=Adaptive(chi2=expression(0.5)))))
    assert kf.update("star", off("body")) == Status.ANOMALY

    def treat(nu, s, r, c):
        excess = nu * nu / 0.5 - s
        return nu, 1.0, 1 + max(excess, 0) / c

    d, P = scalars(np.diag(np.square(STD)), np.eye(3), np.diag(SEEN**2), TURN, treat)
    T = right_jacobian(d)
    assert np.allclose(kf.x, off("body", d), rtol=0, atol=1e-14)
    assert np.allclose(kf.P, T @ P @ T.T, rtol=0, atol=1e-15)


@BOTH
def test_adapt_R(error):
    kf = kfgen.reference(tracker(error, full(adapt_R=expression(0.1)), error))
    P, R, e, q = np.diag(np.square(STD)), np.diag(SEEN**2), np.zeros(3), START
    minus = Space(4, (0,), error).minus
    for k in range(3):
        z = compose(START, exp(TURN * (k + 1)))
        assert kf.update("star", z) == 0
        R = 0.9 * R + 0.1 * (P + np.outer(e, e))
        assert np.allclose(kf.R["star"], R, rtol=0, atol=1e-14)
        K = P @ np.linalg.inv(P + R)
        d = K @ minus(z, q)
        q = compose(q, exp(d)) if error == "body" else compose(exp(d), q)
        T = right_jacobian(d) if error == "body" else left_jacobian(d)
        P = T @ (P - K @ P) @ T.T
        e = minus(z, q)
        assert np.allclose(kf.x, q, rtol=0, atol=1e-13)


def test_adapt_Q():
    kf = kfgen.reference(tracker(chosen=full(adapt_Q=expression(0.1)), Q={"q_rx": 0.5}))
    assert kf.Q.shape == (3, 3)
    kf.update("star", off("body"))
    d, _ = scalars(np.diag(np.square(STD)), np.eye(3), np.diag(SEEN**2), TURN)
    assert np.allclose(kf.Q, np.diag([0.45, 0, 0]) + 0.1 * np.diag(d**2), rtol=0, atol=1e-14)
    before = kf.P
    kf.predict([0, 0, 0])
    assert np.allclose(kf.P, before + kf.Q, rtol=0, atol=1e-15)


@BOTH
def test_consider(error):
    """What is considered is not corrected, but its uncertainty counts."""
    kf = kfgen.reference(tracker(error, full(consider=("q_rz",)), error))
    assert kf.update("star", off(error)) == 0
    d = Space(4, (0,), error).minus(kf.x, START)
    assert abs(d[2]) < 1e-15
    assert np.allclose(d[:2], TURN[:2] * np.square(STD[:2]) / (np.square(STD[:2]) + SEEN[:2] ** 2), rtol=1e-12)


def test_floors_and_ceilings_are_of_errors():
    limits = full(variance_floor={"q_rx": expression(0.01)}, variance_ceiling={"q_rz": expression(0.05)})
    kf = kfgen.reference(tracker(chosen=limits))
    assert kf.update("star", START) == Status.REGULARIZED
    assert kf.P[0, 0] == 0.01
    assert kf.P[2, 2] == pytest.approx(0.09 * 0.04 / 0.13)
    assert kf.predict([0, 0, 0]) == Status.OK
    kf.set_covariance(np.diag([1.0, 1.0, 1.0]))
    assert kf.predict([0, 0, 0]) == Status.REGULARIZED
    assert np.allclose(np.diag(kf.P), [1, 1, 0.05], rtol=1e-14)


def test_gain_limit():
    kf = kfgen.reference(tracker(chosen=full(gain_limit=expression(0.5))))
    assert kf.update("star", off("body", [0.1, 0, 0])) == Status.REGULARIZED
    assert np.allclose(log(compose([0.8, -0.6, 0, 0], kf.x)), [0.05, 0, 0], atol=1e-15)
    assert kf.P[0, 0] == pytest.approx(0.25 * 0.04 + 0.25 * 0.0025)


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_masks_take_a_quaternion_whole_or_not_at_all(kind):
    chosen = full() if kind == "ekf" else inertial.ukf("full")
    seen = star(Q, SEEN, partial=True)
    up = dict(zip("xyz", unrotate(Q, [0, 0, 1]), strict=True))
    more = replace(seen, components=(*seen.components, *sensor("up", up, (0.01,) * 3).components))
    z, missing = np.concatenate([off("body"), [0, 0.9, 0.4]]), np.full(7, np.nan)
    kf, alone, both = (kfgen.reference(tracker(chosen=chosen, sensors=(each,))) for each in (more, seen, more))
    assert kf.update("star", np.concatenate([z[:4], missing[4:]]), mask=0b0001111) == 0
    assert alone.update("star", z[:4]) == 0
    assert np.array_equal(kf.x, alone.x)
    assert np.array_equal(kf.P, alone.P)
    before = kf.x
    assert kf.update("star", missing, mask=0b0000111) == 0
    assert np.array_equal(kf.x, before)
    # the numbers of the quaternion are not looked at where one of them is missing
    assert kf.update("star", np.concatenate([missing[:4], z[4:]]), mask=0b1110111) == 0
    assert not np.array_equal(kf.x, before)
    assert both.update("star", z) == 0
    # but for the steps' order, which a quaternion feels, it is all the same
    assert np.allclose(kf.x, both.x, atol=0.02)


def test_set_state_and_covariance():
    kf = kfgen.reference(tracker())
    assert kf.set_state([0, 0, 3, 4]) == 0
    assert np.array_equal(kf.x, [0, 0, 0.6, 0.8])
    assert kf.set_state([0, 9.9e-4, 0, 0]) == Status.NOT_POSITIVE
    assert kf.set_state([0, 0, 0, 0]) == Status.NOT_POSITIVE
    assert kf.set_state([0, math.nan, 0, 0]) == Status.NOT_FINITE
    assert np.array_equal(kf.x, [0, 0, 0.6, 0.8])
    assert kf.set_state([1.1e-3, 0, 0, 0]) == 0
    assert kf.set_covariance(np.diag([1.0, 2, 3])) == 0
    assert kf.set_covariance(np.diag([1.0, -2, 3])) == Status.NOT_POSITIVE
    with pytest.raises(ValueError, match="reshape"):
        kf.set_covariance(np.eye(4))
    before = kf.x
    assert kf.update("star", [0, 0, 0, 1e-4]) == Status.NOT_POSITIVE
    assert kf.update("star", [0, 0, math.inf, 1]) == Status.NOT_FINITE
    assert np.array_equal(kf.x, before)
    assert kf.update("star", [50, 0, 0, 0]) == 0
    assert np.allclose(kf.x, [1, 0, 0, 0], atol=1e-15)


def test_full_matrices_are_of_errors():
    P0 = np.array([[0.04, 0.01, 0], [0.01, 0.02, 0], [0, 0, 0.09]])
    rows = tuple(tuple(expression(float(v)) for v in row) for row in P0)
    seen = replace(star(Q, SEEN), R=rows)
    spec = tracker(sensors=(replace(seen, rotations=tuple(replace(r, variances=(None,) * 3) for r in seen.rotations)),))
    spec = replace(spec, P0=rows, rotations=tuple(replace(r, variances=(None,) * 3) for r in spec.rotations),
                   dynamics=replace(spec.dynamics, Q=rows))  # fmt: skip
    kf = kfgen.reference(spec)
    assert np.array_equal(kf.P, P0)
    kf.update("star", START)
    assert np.allclose(kf.P, P0 / 2, rtol=0, atol=1e-15)
    kf.predict([0, 0, 0])
    assert np.allclose(kf.P, 1.5 * P0, rtol=0, atol=1e-15)


def bank(error="body"):
    """Two gyro noises."""
    spec = tracker(error, seen=error, noise=dict.fromkeys(("wx", "wy", "wz"), 1e-4))
    rates = zip(ERRORS, GYRO, ("wx", "wy", "wz"), strict=True)
    f = {name: (formula(gyro) - formula(w)).expression for name, gyro, w in rates}
    spec = replace(spec, dynamics=replace(spec.dynamics, f=f))

    def mode(name, variance):
        noise = tuple(replace(each, variance=expression(variance)) for each in spec.noise)
        return Mode(name, spec.states, (), None, noise, None, (), spec.dynamics, spec.measurements, full(),
                    rotations=spec.rotations)  # fmt: skip

    rows = ((expression(0.9), expression(0.1)), (expression(0.2), expression(0.8)))
    modes = (mode("still", 0.01), mode("shaken", 25.0))
    return replace(spec, imm=Imm(modes, rows, (expression(0.5), expression(0.5)), expression(1e-9)))


@BOTH
def test_imm(error):
    """A bank of two gyro noises against one put together from textbook filters."""
    kf, space, M = kfgen.reference(bank(error)), Space(4, (0,), error), np.array([[0.9, 0.1], [0.2, 0.8]])
    seen, R, random = Space(4, (0,), error), np.diag(SEEN**2), np.random.default_rng(4)

    def step(x, w, u, dt):
        return compose(x, exp((u - w) * dt))

    filters = [ErrorState(space, START, np.diag(np.square(STD)), step, np.zeros((3, 3)), v * np.eye(3))
               for v in (0.01, 25.0)]  # fmt: skip
    mu, q = np.array([0.5, 0.5]), START

    def mixed(weights):
        r = filters[int(np.argmax(weights))].x
        x = space.unit(space.plus(r, sum(w * space.minus(f.x, r) for w, f in zip(weights, filters, strict=True))))
        P = np.zeros((3, 3))
        for w, f in zip(weights, filters, strict=True):
            s = space.minus(f.x, x)
            # d((x_i [+] d) [-] x)/dd
            J = np.linalg.inv(right_jacobian(s) if error == "body" else left_jacobian(s))
            P += w * (J @ f.P @ J.T + np.outer(s, s))
        return x, P

    for k in range(60):
        u = np.array([1.0, -2.0, 0.5])
        q = compose(q, exp(0.1 * (u + (5.0 if k // 20 == 1 else 0.1) * random.standard_normal(3))))
        z = compose(q, exp(SEEN * random.standard_normal(3)))
        assert kf.predict(u) == kf.update("star", z) == 0
        c = mu @ M
        for f, (x, P) in zip(filters, [mixed(M[:, j] * mu / c[j]) for j in range(2)], strict=True):
            f.x, f.P = x, P
        likelihood = []
        for f in filters:
            f.predict(u, 0.1)
            S = f.P + R
            y = seen.minus(z, f.x)
            likelihood.append(math.exp(-0.5 * y @ np.linalg.solve(S, y)) / math.sqrt(np.linalg.det(S)))
            f.update(z, lambda x: x, R, measured=seen)
        mu = np.maximum(c * likelihood / np.sum(c * likelihood), 1e-9)
        mu /= np.sum(mu)
        x, P = mixed(mu)
        assert np.allclose(kf.mu, mu, rtol=0, atol=1e-9)
        assert np.allclose(matrix(kf.x), matrix(x), rtol=0, atol=1e-10)
        assert np.allclose(kf.P, P, rtol=0, atol=1e-10)
        if k == 39:
            assert mu[1] > 0.9
    assert mu[0] > 0.6


@BOTH
def test_a_ukf_of_sixty_degrees_is_nearly_honest(error):
    """A tumbling body of which next to nothing is known, 60 degrees about each axis: the mean of the normalised error
    squared, which has three degrees of freedom, is below 5 of a ukf and above 7 of an ekf."""
    points = replace(inertial.ukf().sigma_points, alpha=expression(1), kappa=expression(1))
    up, north = ({f"{n}_{a}": h for a, h in zip("xyz", unrotate(Q, v), strict=True)}
                 for n, v in (("up", [0, 0, 1]), ("north", [1, 0, 0])))  # fmt: skip
    sensors = sensor("up", up, (0.25,) * 3), sensor("north", north, (0.25,) * 3)
    spread = math.pi / 3

    def nees(chosen):
        spec = turning(START, (spread,) * 3, error, f=RATES, inputs=GYRO, sensors=sensors, chosen=chosen,
                       Q=dict.fromkeys(ERRORS, 1e-4))  # fmt: skip
        kf, random, found = kfgen.reference(spec), np.random.default_rng(7), []
        for _ in range(60):
            kf.init()
            q = off(error, spread * random.standard_normal(3))
            for _ in range(4):
                u = np.array([3.0, 1.0, -2.0])
                q = compose(q, exp(0.1 * u + 0.01 * random.standard_normal(3)))
                assert kf.predict(u) == 0
                for name, v in (("up", [0, 0, 1]), ("north", [1, 0, 0])):
                    assert kf.update(name, matrix(q).T @ v + 0.5 * random.standard_normal(3)) == 0
            e = Space(4, (0,), error).minus(q, kf.x)
            found.append(e @ np.linalg.solve(kf.P, e))
        return np.mean(found)

    assert nees(full()) > 7
    for covariance, sequential in (("full", False), ("ud", True)):
        assert nees(replace(inertial.ukf(covariance, sequential=sequential), sigma_points=points)) < 5


@BOTH
@pytest.mark.parametrize("seen", ["body", "reference"])
@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_a_camera_mounted_anywhere(error, seen, kind):
    """h = world q mount, seen with either error."""
    world, mount = exp(np.array([0.3, -2.0, 0.4])), exp(np.array([1.0, 0.2, -0.7]))
    h = product(product([formula(float(v)) for v in world], Q), [formula(float(v)) for v in mount])
    chosen = full() if kind == "ekf" else inertial.ukf("full")
    kf = kfgen.reference(tracker(error, chosen, sensors=(star(h, SEEN, seen),)))
    other = ErrorState(Space(4, (0,), error), START, np.diag(np.square(STD)), None, np.zeros((3, 3)), np.zeros((0, 0)))
    for k in range(4):
        z = compose(compose(world, off(error, 0.7 * k * TURN)), mount)
        assert kf.update("star", (-1) ** k * z) == 0
        given = z, lambda x: compose(compose(world, x), mount), np.diag(SEEN**2)
        if kind == "ekf":
            nis = other.update(*given, measured=Space(4, (0,), seen))
        else:
            nis = other.update_points(*given, cholesky, inertial.WEIGHTS, measured=Space(4, (0,), seen))
        assert kf.nis == pytest.approx(nis, rel=1e-9)
        assert np.allclose(kf.x, other.x, rtol=0, atol=1e-13)
        assert np.allclose(kf.P, other.P, rtol=0, atol=1e-14)
