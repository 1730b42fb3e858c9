"""The reference against results of other implementations (skipped where their files are absent)."""

from __future__ import annotations

import numpy as np
import pytest
from problems import CV4, CV4_OUTLIERS, VEHICLE4

from kfgen.reference import Status, reference
from kfgen.spec import loads
from tests.recorded import peer_rows

FORMS = ["ud, update: bierman", "ud, update: joseph", "full", "full, update: standard", "sqrt"]
PLAIN = [
    (CV4, "cv4", ["filterpy_cv4_ekf", "yafl_cv4_bierman"]),
    (CV4_OUTLIERS, "cv4_outliers", ["yafl_cv4_outliers_bierman"]),
    (VEHICLE4, "vehicle4", ["filterpy_vehicle4_ekf"]),
]
ROBUST, ADAPTIVE = ", robust: chernodarov", ", adaptive: {probability: 0.999}"
OUTLIERS = [
    ("robust_bierman", ROBUST),
    ("robust_joseph", ROBUST),
    ("adaptive_bierman", ADAPTIVE),
    ("adaptive_joseph", ADAPTIVE),
    ("adaptive_bierman", ", adaptive: {chi2: 10.827566170662733}"),
    ("adaptive_robust_bierman", ROBUST + ", adaptive: {probability: 0.997}"),
    ("adaptive_robust_joseph", ROBUST + ", adaptive: true"),
    ("adaptive_robust_bierman_chi2_3", ROBUST + ", adaptive: {chi2: 3}"),
    ("adaptive_robust_bierman_chi2_3", ROBUST + ", adaptive: {probability: 0.9167354833364495}"),
]


def read(name: str) -> np.ndarray:
    return peer_rows(name)


def compare(text: str, problem: str, *peers: str) -> set[int]:
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj): 1e-9.

    Returns the statuses that occurred.
    """
    kf = reference(loads(text))
    results = {peer: {int(row[0]): row[1:] for row in read(peer)} for peer in peers}
    n = kf.model.n
    largest = {peer: np.max(np.abs([row[:n] for row in result.values()]), axis=0) for peer, result in results.items()}
    statuses = set()
    for row, z in enumerate(read(f"in_{problem}")):
        assert kf.predict() == 0
        statuses.add(kf.update("gnss", z))
        for peer, result in results.items():
            if row not in result:
                continue
            x, P = result[row][:n], result[row][n:].reshape(n, n)
            scale = np.sqrt(np.outer(P.diagonal(), P.diagonal()))
            assert np.max(np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest[peer])) < 1e-9, (peer, row)
            assert np.max(np.abs(kf.P - P) / scale) < 1e-9, (peer, row)
    return statuses


@pytest.mark.parametrize(("text", "problem", "peers"), PLAIN)
@pytest.mark.parametrize("form", FORMS)
def test_peer(text, problem, peers, form):
    assert compare(text.replace("type: ekf", f"type: ekf, covariance: {form}"), problem, *peers) == {0}


@pytest.mark.parametrize(("peer", "options"), OUTLIERS)
def test_outliers_treated(peer, options):
    text = CV4_OUTLIERS.replace("type: ekf", f"type: ekf{options}")
    statuses = compare(text, "cv4_outliers", f"yafl_cv4_outliers_{peer}")
    seen = Status(0)
    for status in statuses:
        seen |= Status(status)
    glitches = Status.GLITCH_SMALL | Status.GLITCH_LARGE
    inflates = "adaptive_b" in peer or "adaptive_j" in peer or "chi2" in peer
    assert seen == (glitches if "robust" in peer else 0) | (Status.ANOMALY if inflates else 0)


def after_outliers(options: str) -> float:
    """The RMS error of the position over the 40 rows after rows 200, 500 and 700, where outliers begin."""
    kf = reference(loads(CV4_OUTLIERS.replace("type: ekf", f"type: ekf{options}")))
    rows = {row for start in (200, 500, 700) for row in range(start, start + 40)}
    squares = []
    for row, z in enumerate(read("in_cv4_outliers")):
        kf.predict()
        assert kf.update("gnss", z) < Status.ERROR
        if row in rows:
            truth = np.array([50.0 + (row + 1), 0.2 * (row + 1)])
            squares.append(np.sum((kf.x[:2] - truth) ** 2))
    return float(np.sqrt(np.mean(squares)))


def test_robust_updates_help():
    plain = after_outliers("")
    assert plain == pytest.approx(5.39, abs=0.01)
    assert after_outliers(ROBUST) < 0.85 * plain
    assert after_outliers(", robust: {influence: huber, k: 1.5}") < 0.85 * plain
    # the inflation believes every outlier: it is there for a model that is wrong, not for a wrong measurement
    assert after_outliers(ADAPTIVE) > 5.0 * plain
