"""Float's resolution against a state's steps and its standard deviation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from kfgen.advice.track import Array, Track
from kfgen.errors import Advice
from kfgen.scalar_names import FLOAT
from kfgen.spec.problems import short
from kfgen.spec.types import Spec

Flags = NDArray[np.bool_]

ROUNDINGS = 8  # of a state between what is measured of it, reckoned with
SHARE = 0.1  # of sigma that they may be


def ulp(magnitude: Array) -> Array:
    """The step from a float of this magnitude to the next."""
    grain: Array = np.spacing(np.abs(magnitude).astype(np.float32)).astype(np.float64)
    return grain


def too_coarse(magnitude: Array, sigma: Array) -> Flags:
    """Whether the roundings of a float of this magnitude are no longer small beside sigma, element by element."""
    coarse: Flags = (sigma > 0) & (ROUNDINGS * ulp(magnitude) > SHARE * sigma)
    return coarse


def advice(spec: Spec, tracks: Sequence[Track]) -> Iterator[Advice]:
    if spec.scalar != FLOAT:
        return
    for track in tracks:
        magnitude = track.size.max(axis=0)
        grain, step = ulp(magnitude), np.median(np.abs(track.step), axis=0)
        doubtful = _doubtful(track, grain) & track.real & [name not in spec.code.compensated for name in track.names]
        if not doubtful.any():
            continue
        sigma = _settled(track)
        for i, name in enumerate(track.names):
            lost = 0 < step[i] < grain[i] / 2 and 10 * ROUNDINGS * grain[i] > SHARE * sigma[i] > 0
            if not doubtful[i] or not (lost or too_coarse(magnitude[i : i + 1], sigma[i : i + 1])[0]):
                continue
            moved = f", a step moves it by {step[i]:.2g}" if step[i] else ""
            text = (
                f"float resolves {short(name)} to {grain[i]:.2g} at {magnitude[i]:.3g}{moved}, and its standard "
                f"deviation is {sigma[i]:.2g}: rounding " + ("takes its motion" if lost else "counts beside it")
            )
            cure = "count it from a local origin, or write `scalar: double`"
            yield Advice(track.places[i], text, cure, "far_origin")


def _doubtful(track: Track, grain: Array) -> Flags:
    """States (n) for which sigma may be small enough to matter: a bound that needs no filter."""
    variance = np.diag(track.model.P0).copy()
    for name, H in track.H.items():
        for h, r in zip(H[0], np.diag(track.R[name]), strict=True):
            seen = h != 0
            variance[seen] = np.minimum(variance[seen], r / h[seen] ** 2)
    doubtful: Flags = 10 * ROUNDINGS * grain > SHARE * SHARE * np.sqrt(np.maximum(variance, 0.0))
    return doubtful


def _settled(track: Track) -> Array:
    """Standard deviations (n) after the covariance has settled: the filter's own equations, all sensors in each row."""
    P, n = track.model.P0.copy(), len(track.names)
    rows = len(track.size)
    for k in range(20 * rows):
        F = track.F[k % rows]
        P = F @ P @ F.T + track.Q
        for name, H in track.H.items():
            h, R = H[k % rows], track.R[name]
            S = h @ P @ h.T + R
            gain = np.linalg.lstsq(S, h @ P, rcond=None)[0].T
            left = np.eye(n) - gain @ h
            P = left @ P @ left.T + gain @ R @ gain.T
        if not np.isfinite(P).all():
            return np.full(n, np.inf)
    sigma: Array = np.sqrt(np.maximum(np.diag(P), 0.0))
    return sigma
