"""Satellites in circular orbits, and what a receiver that moves by the model of specs/gnss.yaml measures of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RADIUS, MU, EARTH = 26.56e6, 3.986004418e14, 7.2921159e-5  # m, m^3/s^2, rad/s
START = np.array([-2.167e6, 4.388e6, 4.075e6])  # of the spec, m ECEF
SIGMA, RATE = 1.5, 0.1  # m, m/s
ACCELERATION, CLOCK, DRIFT = 0.5, 0.2, 0.02  # root densities of the noises, per sqrt(s)
FEW = range(150, 210)  # seconds between high walls, with two satellites in view


def satellites(t: float) -> tuple[Array, Array]:
    """Positions and velocities [36, 3] in m, m/s ECEF: six planes of six, 55 degrees to the equator."""
    k = np.arange(36)
    node = np.radians(60.0) * (k // 6) - EARTH * t
    turn = np.sqrt(MU / RADIUS**3)
    along = turn * t + np.radians(60.0) * (k % 6) + np.radians(10.0) * (k // 6)
    tilt = np.radians(55.0)

    def placed(x: Array, y: Array) -> Array:
        """From the plane of each orbit."""
        c, s = np.cos(node), np.sin(node)
        rows = [c * x - s * np.cos(tilt) * y, s * x + c * np.cos(tilt) * y, np.sin(tilt) * y]
        return np.column_stack(rows)

    where = placed(RADIUS * np.cos(along), RADIUS * np.sin(along))
    inertial = placed(-RADIUS * turn * np.sin(along), RADIUS * turn * np.cos(along))
    carried = np.cross([0.0, 0.0, EARTH], where)
    return where, inertial - carried


def in_view(where: Array, most: int) -> Array:
    """The numbers of the satellites above 5 degrees of elevation, the highest first, at most so many."""
    line = where - START
    up = line @ (START / np.linalg.norm(START)) / np.linalg.norm(line, axis=1)
    seen = np.flatnonzero(up > np.sin(np.radians(5.0)))
    return seen[np.argsort(-up[seen])][:most]


@dataclass
class Drive:
    """Rows of a log of the spec, and the truth [seconds, 8] after each prediction."""

    truth: Array
    seen: list[int] = field(default_factory=list)  # satellites in each second
    rows: list[list[float]] = field(default_factory=list)  # t, pos, vel, sigma, rho, rate

    NAMES = ("t", *(f"sat.{v}_{axis}" for v in ("pos", "vel") for axis in "xyz"), "sat.sigma", "sat.rho", "sat.rate")

    @property
    def log(self) -> dict[str, Array]:
        return dict(zip(self.NAMES, np.array(self.rows).T, strict=True))


def drive(seed: int, seconds: int = 300) -> Drive:
    """Drawn from the spec's own model, from its own first estimate. 4 to 12 satellites, and two for a while."""
    random = np.random.default_rng(seed)
    # x of p, v, clock, drift; noises integrated over a second (Brown & Hwang 2012, 4.2)
    F = np.eye(8)
    F[:3, 3:6], F[6, 7] = np.eye(3), 1.0
    pair = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    roots = {q: np.linalg.cholesky(q**2 * pair) for q in (ACCELERATION, DRIFT)}
    std = np.array([3000.0] * 3 + [10.0] * 3 + [1e5, 100.0])  # of the spec; a clock of 0.3 ms is off enough
    x = np.concatenate([START, np.zeros(5)]) + std * random.normal(size=8)
    out = Drive(np.empty((seconds, 8)))
    limit = 12
    for k in range(seconds):
        x = F @ x
        for axis in range(3):
            x[[axis, axis + 3]] += roots[ACCELERATION] @ random.normal(size=2)
        x[6:] += roots[DRIFT] @ random.normal(size=2)
        x[6] += CLOCK * random.normal()
        out.truth[k] = x
        if k % 20 == 0:
            limit = int(random.integers(4, 13))
        where, moving = satellites(float(k))
        chosen = in_view(where, 2 if k in FEW else limit)
        out.seen.append(len(chosen))
        for i in chosen:
            line = where[i] - x[:3]
            distance = np.linalg.norm(line)
            rho = distance + x[6] + SIGMA * random.normal()
            rate = line @ (moving[i] - x[3:6]) / distance + x[7] + RATE * random.normal()
            out.rows.append([float(k), *where[i], *moving[i], SIGMA, rho, rate])
    return out
