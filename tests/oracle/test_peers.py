"""The reference against results of other implementations (skipped where their files are absent)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from problems import CV4, CV4_OUTLIERS, VEHICLE4

from kfgen.reference import reference
from kfgen.spec import loads

PEERS = Path(__file__).resolve().parents[3] / "shared" / "peers"
pytestmark = pytest.mark.skipif(not PEERS.is_dir(), reason="no peers folder")


def read(name: str) -> np.ndarray:
    return np.loadtxt(PEERS / f"{name}.csv", delimiter=",", skiprows=1, ndmin=2)


@pytest.mark.parametrize(
    ("text", "problem", "peer"),
    [
        (CV4, "cv4", "filterpy_cv4_ekf"),
        (CV4, "cv4", "yafl_cv4_bierman"),
        (CV4_OUTLIERS, "cv4_outliers", "yafl_cv4_outliers_bierman"),
        (VEHICLE4, "vehicle4", "filterpy_vehicle4_ekf"),
    ],
)
@pytest.mark.parametrize(
    "form", ["ud, update: bierman", "ud, update: joseph", "full", "full, update: standard"]
)
def test_peer(text, problem, peer, form):
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj): 1e-9."""
    kf = reference(loads(text.replace("type: ekf", f"type: ekf, covariance: {form}")))
    result = {int(row[0]): row[1:] for row in read(peer)}
    n = kf.model.n
    largest = np.max(np.abs([row[:n] for row in result.values()]), axis=0)
    error_x = error_P = 0.0
    for row, z in enumerate(read(f"in_{problem}")):
        assert kf.predict() == 0
        assert kf.update("gnss", z) == 0
        if row not in result:
            continue
        x, P = result[row][:n], result[row][n:].reshape(n, n)
        scale = np.sqrt(np.outer(P.diagonal(), P.diagonal()))
        error_x = max(error_x, np.max(np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest)))
        error_P = max(error_P, np.max(np.abs(kf.P - P) / scale))
    assert error_x < 1e-9
    assert error_P < 1e-9
