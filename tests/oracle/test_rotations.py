"""The reference's filters of rotations against error-state filters of the textbooks, on an inertial problem."""

from __future__ import annotations

import numpy as np
import pytest

import kfgen
from kfgen.spec.types import Filter
from tests.oracle import inertial
from tests.oracle.error_state import Space, cholesky, upper

BOTH = pytest.mark.parametrize("error", ["body", "reference"])


def follow(kf, other, update, sensors=("gnss", "mag"), rows=400, predict=None):
    """The largest distance of the two along the readings."""
    worst = 0.0
    for u, z, _ in inertial.readings(rows):
        assert kf.predict(u) == 0
        (predict or other.predict)(u, inertial.DT)
        for name in sensors:
            if name in z:
                assert kf.update(name, z[name]) == 0
                update(name, z[name])
        worst = max(worst, inertial.apart(kf, other))
    return worst


@BOTH
@pytest.mark.parametrize("reset", [True, False])
def test_ekf(error, reset):
    kf, other = kfgen.reference(inertial.spec(error, reset)), inertial.textbook(error)
    nis = []

    def update(name, z):
        nis.append(kf.nis / other.update(z, *inertial.SENSORS[name], reset=reset))

    assert follow(kf, other, update) < 1e-9
    assert np.allclose(nis, 1.0, rtol=0, atol=1e-9)


@BOTH
@pytest.mark.parametrize("times", [1, 3])
def test_iekf(error, times):
    kf = kfgen.reference(inertial.spec(error, chosen=Filter("iekf", "full", "joseph", iterations=times), star=error))
    other = inertial.textbook(error)

    def update(name, z):
        other.iterate(z, *inertial.SENSORS[name], times, measured(name, error))

    assert follow(kf, other, update, inertial.SENSORS) < 1e-9


def measured(name, error):
    return Space(4, (0,), error) if name == "star" else None


@BOTH
@pytest.mark.parametrize("seen", ["body", "reference"])
def test_measured_quaternion(error, seen):
    kf, other = kfgen.reference(inertial.spec(error, star=seen)), inertial.textbook(error)

    def update(name, z):
        other.update(z, *inertial.SENSORS[name], measured=measured(name, seen))

    assert follow(kf, other, update, inertial.SENSORS) < 1e-9


@BOTH
@pytest.mark.parametrize("covariance", ["ud", "full", "sqrt"])
@pytest.mark.parametrize("redraw", [True, False])
def test_ukf(error, covariance, redraw):
    """Kept points are used by the first sensor after a predict."""
    kf = kfgen.reference(inertial.spec(error, chosen=inertial.ukf(covariance, redraw), star=error))
    other, root = inertial.textbook(error), upper if covariance == "ud" else cholesky
    fresh = [False]

    def predict(u, dt):
        other.predict_points(u, dt, root, inertial.WEIGHTS)
        fresh[0] = not redraw

    def update(name, z):
        h, R = inertial.SENSORS[name]
        other.update_points(z, h, R, root, inertial.WEIGHTS, measured=measured(name, error), kept=fresh[0])
        fresh[0] = False

    assert follow(kf, other, update, inertial.SENSORS, 120, predict) < 1e-8


@BOTH
@pytest.mark.parametrize("augment", [True, False])
@pytest.mark.parametrize("reset", [True, False])
def test_ukf_one_by_one_and_with_noise_in_its_points(error, augment, reset):
    chosen = inertial.ukf("ud", sequential=True, augment=augment)
    kf, other = kfgen.reference(inertial.spec(error, reset, chosen, star=error)), inertial.textbook(error)

    def predict(u, dt):
        other.predict_points(u, dt, upper, inertial.WEIGHTS, augment)

    def update(name, z):
        h, R = inertial.SENSORS[name]
        other.update_points(z, h, R, upper, inertial.WEIGHTS, reset, measured(name, error), sequential=True)

    assert follow(kf, other, update, inertial.SENSORS, 60, predict) < 1e-8
