"""A flight for specs/ins.yaml: an inertial unit that drifts and then flies turns; what its sensors read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.oracle.error_state import compose, exp, matrix

DT = 0.01
GRAVITY = np.array([0, 0, -9.80665])
LEVER = np.array([0.3, 0.1, 0.8])
FIELD = np.array([22.0, 0, -42])
STILL = 20  # rows

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """Row by row: truth [rows, 16] in the order of the spec's states, inputs [rows, 6] of the step that leads there,
    and readings: (row, sensor, values)."""

    truth: Vector
    inputs: Vector
    readings: list[tuple[int, str, Vector]]


def fly(seed: int, off: float, rows: int = 1000) -> Flight:
    """The body drifts, turned by `off` rad about some axis, and then flies curves, rolling and pitching."""
    random = np.random.default_rng(seed)
    axis = random.standard_normal(3)
    q = exp(off * axis / np.linalg.norm(axis))
    p, v = 3 * random.standard_normal(3), 0.5 * random.standard_normal(3)
    bg, ba = 0.01 * random.standard_normal(3), 0.05 * random.standard_normal(3)
    phase = random.uniform(0, 6.28, 6)
    truth, inputs, readings = [], [], []
    for k in range(rows):
        t = max(0, k - STILL) * DT
        moving = min(1.0, t)
        rate = moving * np.array([0.6, 0.5, 0.8]) * np.sin([0.9, 1.3, 0.4] * np.full(3, t) + phase[:3])
        force = moving * np.array([2.0, 2.0, 1.0]) * np.sin([0.7, 0.5, 1.1] * np.full(3, t) + phase[3:])
        felt = matrix(q).T @ (force - GRAVITY)
        gyro = rate + bg + 0.002 / np.sqrt(DT) * random.standard_normal(3)
        accel = felt + ba + 0.02 / np.sqrt(DT) * random.standard_normal(3)
        p, v, q = p + DT * v, v + DT * force, compose(q, exp(DT * rate))
        truth.append([*p, *v, *q, *bg, *ba])
        inputs.append([*gyro, *accel])
        if k % 2 == 0:
            readings.append((k, "mag", matrix(q).T @ FIELD + 0.3 * random.standard_normal(3)))
        if k % 10 == 9:
            R = matrix(q)
            antenna = [*(p + R @ LEVER), *(v + R @ np.cross(rate, LEVER))]
            readings.append((k, "gnss", np.array(antenna) + [1, 1, 2, 0.1, 0.1, 0.1] * random.standard_normal(6)))
    return Flight(np.array(truth), np.array(inputs), readings)
