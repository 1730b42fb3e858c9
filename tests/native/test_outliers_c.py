"""The emitted C against the robust and adaptive filters of another implementation (skipped where its results are not).

A difference in one form is that layout's; in all of them, the influence function's or the inflation's.
"""

from __future__ import annotations

import numpy as np
import pytest
from emitted import problems
from variants import FORMS, built, spec_with

from kfgen.status import Status
from tests.recorded import peer_rows

SMALL, LARGE, ANOMALY = Status.GLITCH_SMALL, Status.GLITCH_LARGE, Status.ANOMALY
# options -> problem, the files that have to be met, the flags that the run raises, the forms
RUNS = {
    "type: kf": ("cv4", ["bierman"], Status.OK, ["sqrt"]),  # for the other forms: test_numerics
    "type: ekf": ("cv4_outliers", ["bierman"], Status.OK, ["sqrt"]),
    "robust: chernodarov": ("cv4_outliers", ["robust_bierman", "robust_joseph"], SMALL | LARGE, [*FORMS]),
    "adaptive: true": ("cv4_outliers", ["adaptive_bierman", "adaptive_joseph"], ANOMALY, [*FORMS]),
    "robust: chernodarov, adaptive: true": (
        "cv4_outliers", ["adaptive_robust_bierman", "adaptive_robust_joseph"], SMALL | LARGE, ["ud-bierman"],
    ),
    "robust: chernodarov, adaptive: {probability: 0.9167354833364495}": (
        "cv4_outliers", ["adaptive_robust_bierman_chi2_3"], SMALL | LARGE | ANOMALY,
        ["ud-joseph", "full-standard", "sqrt"],
    ),
}  # fmt: skip


def read(name: str) -> np.ndarray:
    return peer_rows(name)


@pytest.mark.parametrize("options", RUNS)
def test_peers(options):
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj): 1e-9."""
    problem, peers, wanted, forms = RUNS[options]
    results = [read(f"yafl_{problem}_{peer}") for peer in peers]
    inputs, rows = read(f"in_{problem}"), results[0][:, 0].astype(int)
    largest = np.max(np.abs(results[0][:, 1:5]), axis=0)
    filters = built({form: spec_with(problems.ALL[problem], options, form) for form in forms})
    for form, kf in filters.items():
        seen, found = Status.OK, []
        for row, z in enumerate(inputs):
            assert kf.predict() == 0
            seen |= Status(kf.update("gnss", z))
            if row in rows:
                found.append([row, *kf.x, *kf.P.ravel()])
        assert seen == wanted, form
        ours = np.array(found)
        for peer, theirs in zip(peers, results, strict=True):
            assert np.array_equal(ours[:, 0], theirs[:, 0])
            x, P = theirs[:, 1:5], theirs[:, 5:].reshape(-1, 4, 4)
            variances = np.diagonal(P, axis1=1, axis2=2)
            scale = np.sqrt(variances[:, :, None] * variances[:, None, :])
            error_x = np.max(np.abs(ours[:, 1:5] - x) / np.maximum(np.abs(x), 1e-3 * largest))
            error_P = np.max(np.abs(ours[:, 5:].reshape(-1, 4, 4) - P) / scale)
            print(f"{form} {peer}: x {error_x:.1e}, P {error_P:.1e}")
            assert error_x < 1e-9, (form, peer)
            assert error_P < 1e-9, (form, peer)
