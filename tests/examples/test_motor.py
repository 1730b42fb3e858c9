"""A motor without a position sensor: the angle is found from the currents alone, and known as well as it says."""

from __future__ import annotations

import numpy as np
import pytest

from kfgen.simulate import simulate
from tests.examples.conftest import truth


@pytest.fixture(scope="module")
def motor(build):
    return build("motor")


def test_the_angle_is_found_within_a_tenth_of_a_second(motor):
    """From half a radian off, at 200 rad/s: under 0.05 rad, a degree of twenty mechanical ones."""
    errors = []
    for seed in range(3):
        log = simulate(motor.spec, 2500, seed=seed)
        motor.init()
        found = motor.run(log).x[:, 3] - truth(motor, log)[:, 3]
        errors.append(np.angle(np.exp(1j * found)))
    first, last = np.abs(errors)[:, :20].max(), np.sqrt(np.mean(np.square(errors)[:, 1500:]))
    assert first > 0.2
    assert last < 0.05


def test_what_it_says_of_itself_holds(motor, consistency):
    nees, nis = consistency(motor, 1200, 8)
    assert 0.5 < nees < 1.6  # 8 runs of 4 states: 1 +- 0.25 at one sigma
    assert nis == pytest.approx(1, abs=0.04)


def test_at_rest_the_angle_is_not_told(motor):
    """What the spec warns of: nothing is induced, so nothing is learnt of the angle, and P says so."""
    motor.init()
    motor.set_state([0, 0, 0, 1.0])
    P = motor.P.copy()
    P[2, 2] = 1e-4
    motor.set_covariance(P)
    for _ in range(400):
        motor.predict([0, 0])
        motor.update("currents", [0, 0])
    assert motor.P[3, 3] > 0.2
