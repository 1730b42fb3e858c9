"""The inertial problem on which filters of rotations are held against each other: p, v, q, two biases; 15 errors, 6
noises, a body that tumbles at 3 rad/s, 400 rows. As a spec, as plain numpy, and as readings."""

from __future__ import annotations

import numpy as np

from kfgen.spec.types import (
    Component,
    Dynamics,
    Filter,
    Input,
    Noise,
    Rotation,
    Sensor,
    SigmaPoints,
    Spec,
    State,
    Step,
)
from tests.oracle import error_state as numpy_filter
from tests.oracle.formulas import expressions, formula, quaternion, rotate, unrotate, vector

DT = 0.02
GRAVITY = np.array([0.0, 0.0, -9.80665])
FIELD = np.array([22.0, 0.0, -42.0])
START = np.array([0, 0, 0, 1, 0, 0, 0.9, 0.1, -0.3, 0.2, 0, 0, 0, 0, 0, 0], float)
STD = np.repeat([2.0, 0.5, 0.2, 0.02, 0.1], 3)
GYRO, ACCEL = 0.01, 0.1  # of the noises, per step
WALK = 1e-9
GNSS, MAG, STAR = np.array([1.0, 1.0, 2.0]), 0.5, np.array([0.01, 0.01, 0.03])

NAMES = [*(f"p_{a}" for a in "xyz"), *(f"v_{a}" for a in "xyz"), *(f"q_{a}" for a in "wxyz"),
         *(f"bg_{a}" for a in "xyz"), *(f"ba_{a}" for a in "xyz")]  # fmt: skip


def expression(v):
    return formula(v).expression


def spec(error="body", reset=True, chosen=None, star=False, **changes):
    """The problem as a spec; chosen: its filter."""
    q, p, v, bg, ba = quaternion("q"), vector("p"), vector("v"), vector("bg"), vector("ba")
    accel, gyro, wa, wg = vector("accel"), vector("gyro"), vector("wa"), vector("wg")
    force = rotate(q, [a - b - w for a, b, w in zip(accel, ba, wa, strict=True)])
    f = expressions(NAMES[:3], v)
    f |= expressions(NAMES[3:6], [a + float(g) for a, g in zip(force, GRAVITY, strict=True)])
    f |= expressions(("q_rx", "q_ry", "q_rz"), [a - b - w for a, b, w in zip(gyro, bg, wg, strict=True)])
    variance = dict(zip([*NAMES[:6], "", "q_rx", "q_ry", "q_rz", *NAMES[10:]], [*STD[:6], 0, *STD[6:]], strict=True))
    states = tuple(
        State(name, expression(float(START[i])), None if name[0] == "q" else expression(float(variance[name] ** 2)),
              kind="quaternion" if name[0] == "q" else "real")
        for i, name in enumerate(NAMES)
    )  # fmt: skip
    rotation = Rotation("q", ("q_w", "q_x", "q_y", "q_z"), ("q_rx", "q_ry", "q_rz"), error, reset,
                        tuple(expression(float(s**2)) for s in STD[6:9]))  # fmt: skip
    field = unrotate(q, [formula(float(b)) for b in FIELD])
    sensors = [
        Sensor("gnss", tuple(Component(f"p_{a}", p[i].expression, expression(float(GNSS[i] ** 2)))
                             for i, a in enumerate("xyz"))),
        Sensor("mag", tuple(Component(f"b_{a}", field[i].expression, expression(MAG**2)) for i, a in enumerate("xyz"))),
    ]  # fmt: skip
    if star:
        seen = Rotation("q", ("q_w", "q_x", "q_y", "q_z"), ("q_rx", "q_ry", "q_rz"), star, True,
                        tuple(expression(float(s**2)) for s in STAR))  # fmt: skip
        parts = tuple(Component(f"q_{a}", q[i].expression, kind="quaternion") for i, a in enumerate("wxyz"))
        sensors.append(Sensor("star", parts, rotations=(seen,)))
    return Spec(
        **{
            "name": "inertial",
            "file": "inertial.yaml",
            "sha256": "",
            "scalar": "double",
            "dt": Step(expression(DT)),
            "states": states,
            "inputs": tuple(Input(f"{name}_{a}") for name in ("gyro", "accel") for a in "xyz"),
            "noise": tuple(Noise(f"{name}_{a}", expression(s**2)) for name, s in (("wg", GYRO), ("wa", ACCEL))
                           for a in "xyz"),
            "dynamics": Dynamics("continuous", f, "rk4", 1, {f"bg_{a}": expression(WALK) for a in "xyz"}),
            "measurements": tuple(sensors),
            "filter": chosen or Filter("ekf", "full", "joseph"),
            "rotations": (rotation,),
        }
        | changes
    )  # fmt: skip


def ukf(covariance="ud", redraw=True, **options):
    points = SigmaPoints("merwe", *(expression(v) for v in WEIGHTS), redraw=redraw)
    return Filter("ukf", covariance, None, sigma_points=points, **options)


WEIGHTS = (0.5, 2.0, 0.0)


def step(x, w, u, dt):
    """The classical Runge-Kutta step of p and v along an attitude that turns at a constant rate."""
    p, v, q, bg, ba = x[:3], x[3:6], x[6:10], x[10:13], x[13:]
    rate, a = u[:3] - bg - w[:3], u[3:] - ba - w[3:]

    def acceleration(part):
        return numpy_filter.matrix(numpy_filter.compose(q, numpy_filter.exp(rate * (part * dt)))) @ a + GRAVITY

    first, middle, last = acceleration(0.0), acceleration(0.5), acceleration(1.0)
    after = v + dt / 6 * (first + 4 * middle + last)
    place = p + dt * v + dt**2 / 6 * (first + 2 * middle)
    return np.concatenate([place, after, numpy_filter.compose(q, numpy_filter.exp(rate * dt)), bg, ba])


SENSORS = {
    "gnss": (lambda x: x[:3], np.diag(GNSS**2)),
    "mag": (lambda x: numpy_filter.matrix(x[6:10]).T @ FIELD, np.diag([MAG**2] * 3)),
    "star": (lambda x: x[6:10], np.diag(STAR**2)),
}


def textbook(error="body"):
    """The problem in plain numpy."""
    Q = np.zeros((15, 15))
    Q[9:12, 9:12] = WALK * np.eye(3)
    return numpy_filter.ErrorState(numpy_filter.Space(16, (6,), error), START, np.diag(STD**2), step, Q,
                                   np.diag(np.repeat([GYRO**2, ACCEL**2], 3)))  # fmt: skip


def readings(rows=400, seed=0):
    """u, and z by sensor, None where there is none: of a body that tumbles at 3 rad/s about an axis that wanders."""
    random, x = np.random.default_rng(seed), START.copy()
    x[:3] += STD[:3] * random.standard_normal(3)
    x[6:10] = numpy_filter.compose(x[6:10], numpy_filter.exp(STD[6:9] * random.standard_normal(3)))
    x[10:13], x[13:] = 0.02 * random.standard_normal(3), 0.1 * random.standard_normal(3)
    for k in range(rows):
        axis = np.array([np.sin(0.01 * k), np.cos(0.013 * k), 0.5])
        rate = 3.0 * axis / np.linalg.norm(axis)
        force = np.array([np.sin(0.05 * k), 0.3, 9.8 + np.cos(0.03 * k)])
        u = np.concatenate([rate + x[10:13], force + x[13:]]) + np.repeat([GYRO, ACCEL], 3) * random.standard_normal(6)
        x = step(x, np.zeros(6), np.concatenate([rate + x[10:13], force + x[13:]]), DT)
        x[6:10] /= np.linalg.norm(x[6:10])
        z = {}
        if k % 5 == 4:
            z["gnss"] = x[:3] + GNSS * random.standard_normal(3)
        if k % 2 == 1:
            z["mag"] = SENSORS["mag"][0](x) + MAG * random.standard_normal(3)
        if k % 7 == 6:
            turn = numpy_filter.exp(STAR * random.standard_normal(3))
            z["star"] = numpy_filter.compose(x[6:10], turn) * (-1) ** k
        yield u, z, x


def apart(kf, other):
    """How far the reference is from the textbook: of x in standard deviations, of P relative to them."""
    sigma = np.sqrt(np.diag(other.P))
    d = other.space.minus(kf.x, other.x) / sigma
    return max(np.max(np.abs(d)), np.max(np.abs(kf.P - other.P) / np.outer(sigma, sigma)))
