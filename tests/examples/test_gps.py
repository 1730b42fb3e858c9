"""specs/gps.yaml over 25 epochs of a receiver at rest."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def kf(build):
    return build("gps")


@pytest.fixture(scope="module")
def log(kf, recorded):
    return recorded(kf, "gps")


@pytest.fixture
def result(kf, log):
    kf.init()
    return kf.run(log)


def satellites(log):
    """Positions [epoch, 4, 3] and pseudoranges [epoch, 4] in m."""
    positions = [[log.columns[f"s{k}{axis}"] for axis in "xyz"] for k in (1, 2, 3, 4)]
    ranges = [log.columns[f"range.r{k}"] for k in (1, 2, 3, 4)]
    return np.array(positions).transpose(2, 0, 1), np.array(ranges).T


def fix(positions, ranges):
    """Position and clock error [4] of a single epoch, by by Gauss-Newton, without a filter."""
    x = np.zeros(4)
    for _ in range(20):
        line = positions - x[:3]
        distance = np.linalg.norm(line, axis=1)
        H = np.column_stack([-line / distance[:, None], np.ones(4)])
        x = x + np.linalg.solve(H, ranges - distance - x[3])
    return x


def test_ends_where_the_single_fixes_scatter(log, result):
    fixes = np.array([fix(*epoch) for epoch in zip(*satellites(log), strict=True)])
    mean, scatter = fixes[:, :3].mean(axis=0), fixes[:, :3].std(axis=0)
    end, sigma = result.x[-1, :3], np.sqrt(result.var[-1, :3])
    assert not result.counts(errors=True)
    assert np.all(np.abs(end - mean) < 0.5)  # measured: 0.02 m; it started 2.4 km off
    assert np.all(sigma < scatter / 3)  # measured: 0.29, 0.74, 1.78 of 1.5, 3.4, 9.2 m


def test_the_position_comes_to_rest(result):
    assert np.all(result.x[10:, :3].std(axis=0) < [0.3, 1.2, 2.0])  # measured: 0.09, 0.54, 0.83 m


def test_the_clock_runs_evenly(result):
    assert np.all(np.abs(result.x[5:, 4] - 44.5) < 0.5)  # m/s, or 0.15 us/s; single fixes give 44.3
    assert np.all(np.sqrt(result.var[10:, 4]) < 0.3)


def test_residuals_are_what_the_spec_says(log, result):
    positions, ranges = satellites(log)
    distance = np.linalg.norm(positions - result.x[:, None, :3], axis=2)
    residual = (ranges - distance - result.x[:, 3:4])[5:]
    assert residual.std() < 1.5  # measured: 0.9 m
    assert np.all(np.abs(residual.mean(axis=0)) < 0.5)
    assert 0.5 < result.nis["range"][1:].mean() / 4 < 1.5  # measured: 0.91


def test_float_would_not_do(build, log, result):
    """Why the spec says double: with pseudoranges rounded to 2 m the residuals are no longer the noise."""
    rounded = build("gps", scalar="float").run(log)
    assert rounded.nis["range"][1:].mean() / 4 > 1.8  # measured: 2.3
    assert np.linalg.norm((rounded.x - result.x)[-1, :3]) > 1  # measured: 1.8 m, a single sigma
