"""specs/beetle.yaml over the recorded track of a beetle, which runs straight for 20 s and then winds about."""

from __future__ import annotations

import numpy as np


def test_the_mode_follows_the_track(build, recorded):
    kf = build("beetle")
    log = recorded(kf, "beetle")
    result = kf.run(log)
    assert result.mu is not None
    assert not result.counts(errors=True)
    turning = result.mu[:, 1]
    straight = (result.t > 12) & (result.t < 33)
    assert np.mean(turning[straight]) < 0.2  # measured: 0.10
    assert np.mean(turning[result.t > 33]) > 0.5  # measured: 0.61


def test_the_mode_follows_how_straight_the_track_is(build, recorded):
    """Straightness: what is gained in 5 s as a part of the way gone."""
    kf = build("beetle")
    log = recorded(kf, "beetle")
    result = kf.run(log)
    assert result.mu is not None
    z = np.column_stack([log.columns["camera.x"], log.columns["camera.y"]])
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(z, axis=0).T))])
    first = np.maximum(np.arange(len(z)) - 6, 0)
    last = np.minimum(np.arange(len(z)) + 6, len(z) - 1)
    straightness = np.hypot(*(z[last] - z[first]).T) / (way[last] - way[first])
    running, winding = straightness > 0.9, straightness < 0.7
    difference = np.mean(result.mu[winding, 1]) - np.mean(result.mu[running, 1])
    assert difference > 0.3  # measured: 0.48


def test_innovations_are_what_the_filter_expects(build, recorded):
    kf = build("beetle")
    result = kf.run(recorded(kf, "beetle"))
    assert 0.4 < np.nanmean(result.nis["camera"]) / 2 < 1.2  # the smaller of two modes; measured: 0.63
