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
