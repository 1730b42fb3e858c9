"""specs/gnss.yaml: one sensor, called once for each satellite, over drives with 4 to 12 in view, and with two."""

from __future__ import annotations

import numpy as np
import pytest
from constellation import FEW, Drive, drive

from kfgen.status import Status

RUNS = 12


@pytest.fixture(scope="module")
def kf(build):
    return build("gnss")


@pytest.fixture(scope="module")
def drives():
    return [drive(seed) for seed in range(RUNS)]


def followed(kf, driven: Drive):
    """Errors [seconds, 8], covariances [seconds, 8, 8] and statuses after each second's calls."""
    kf.init()
    errors, covariances, statuses = [], [], []
    rows = iter(driven.rows)
    for truth, seen in zip(driven.truth, driven.seen, strict=True):
        assert kf.predict() == 0
        for _, row in zip(range(seen), rows, strict=False):
            statuses.append(kf.update("sat", row[8:], inputs=row[1:8]))
        errors.append(kf.x - truth)
        covariances.append(kf.P)
    return np.array(errors), np.array(covariances), np.array(statuses)


@pytest.fixture(scope="module")
def runs(kf, drives):
    return [followed(kf, driven) for driven in drives]


def test_few_and_many_satellites(drives):
    seen = np.array([driven.seen for driven in drives])
    assert (seen[:, FEW.start : FEW.stop] == 2).all()
    others = np.delete(seen, np.arange(FEW.start, FEW.stop), axis=1)
    assert others.min() == 4
    assert others.max() == 12


def test_is_as_sure_as_it_may_be(runs):
    """The NEES of each stretch lies in its band, the one with two satellites too."""
    nees = np.array([
        np.einsum("ki,ki->k", e, np.linalg.solve(P, e[:, :, None])[:, :, 0]) / 8 for e, P, _ in runs
    ])  # fmt: skip
    for part in (slice(0, 1), slice(1, 20), slice(20, FEW.start), slice(FEW.start, FEW.stop), slice(FEW.stop, 300)):
        means = nees[:, part].mean(axis=1)
        band = 2.576 * means.std(ddof=1) / np.sqrt(RUNS)  # steps of a run are correlated: between the runs
        assert abs(means.mean() - 1) < band, part  # measured: within 0.06 of 1
        assert band < 0.5


def test_errors_are_as_large_as_their_sigma(runs):
    ratio = np.array([e / np.sqrt(np.diagonal(P, axis1=1, axis2=2)) for e, P, _ in runs])
    assert np.all(np.abs(np.sqrt((ratio[:, 20:] ** 2).mean(axis=(0, 1))) - 1) < 0.15)


def test_knows_where_it_is_and_when_it_does_not(runs):
    error = np.array([np.linalg.norm(e[:, :3], axis=1) for e, _, _ in runs])
    sigma = np.array([np.sqrt(np.trace(P[:, :3, :3], axis1=1, axis2=2)) for _, P, _ in runs])
    assert np.sqrt((error[:, 20 : FEW.start] ** 2).mean()) < 1.5  # m, of ranges of 1.5 m; measured: 0.87
    assert sigma[:, FEW.stop - 1].min() > 30  # it says that it has lost its way
    assert np.all(sigma[:, FEW.stop + 20] < 3)  # and finds back
    assert np.all(error[:, FEW.stop + 20] < 6)


def test_a_log_has_a_row_for_each_satellite(kf, drives, runs):
    """Rows of one t are calls of one step: the same bits as the calls one by one."""
    kf.init()
    result = kf.run(drives[0].log)
    last = np.cumsum(drives[0].seen) - 1
    np.testing.assert_array_equal(result.x[last] - drives[0].truth, runs[0][0])
    speed = np.linalg.norm(result.x[last, 3:6], axis=1)
    np.testing.assert_allclose(result.outputs["speed"][last], speed, rtol=1e-12)
    assert np.all(result.output_std["speed"][last][20:150] < 0.5)


def test_a_reflected_signal_is_refused(kf, drives, runs):
    assert max(np.count_nonzero(status) for _, _, status in runs) < 10  # of some 2000 good ones
    kf.init()
    rows = [row for row in drives[0].rows if row[0] < 30]
    for before, row in zip([[-1.0], *rows], rows, strict=False):
        if row[0] != before[0]:
            kf.predict()
        assert kf.update("sat", row[8:], inputs=row[1:8]) == 0
    x = kf.x
    *_, rho, rate = rows[-1]
    assert kf.update("sat", [rho + 60.0, rate], inputs=rows[-1][1:8]) == Status.GATED
    np.testing.assert_array_equal(kf.x, x)


def test_without_doppler_over_recorded_ranges(build, kf, recorded):
    """The receiver at rest of gps.yaml, whose log has four satellites in a row."""
    four = build("gps")
    log = recorded(four, "gps")
    epochs = log.rows
    columns = {"t": np.repeat(log.columns["t"], 4), "sat.sigma": np.ones(4 * epochs)}
    for axis in "xyz":
        columns[f"sat.pos_{axis}"] = np.ravel([log.columns[f"s{k}{axis}"] for k in (1, 2, 3, 4)], order="F")
        columns[f"sat.vel_{axis}"] = np.zeros(4 * epochs)
    columns["sat.rho"] = np.ravel([log.columns[f"range.r{k}"] for k in (1, 2, 3, 4)], order="F")
    columns["sat.rate"] = np.full(4 * epochs, np.nan)
    kf.init()
    result = kf.run(columns)
    assert not result.counts()
    sigma = np.sqrt(result.var[-1, :3])
    rest = four.run(log).x[-1, :3]
    assert np.all(np.abs(result.x[-1, :3] - rest) < 3 * sigma)
    assert np.all(sigma < 8)
