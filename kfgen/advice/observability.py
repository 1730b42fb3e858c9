"""States that no sensor sees: the null space of the observability matrix along a simulated track."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kfgen.advice.track import Array, Track
from kfgen.errors import Advice
from kfgen.spec.problems import short
from kfgen.spec.types import Spec

RANK = 1e-11  # of columns of unit length: below it a singular value is round-off
SHARE = 1e-4  # of a direction: a state with less has no part in it


def advice(spec: Spec, tracks: Sequence[Track]) -> Iterator[Advice]:
    blind = _unseen(tracks)
    if not blind.size:
        return
    names, places = tracks[0].names, tracks[0].places
    silent = {i for i in range(len(names)) if _known(tracks, i)}
    for group in _groups(blind):
        if silent & set(group) or any(names[i] in track.spec.filter.consider for track in tracks for i in group):
            continue  # what nobody claims to estimate
        first = group[0]
        if len(group) == 1:
            text = f"no sensor sees {short(names[first])}, neither itself nor by what it does to other states"
            cure = "measure something that depends on it, remove it, or give it to `consider`"
        else:
            listed = ", ".join(short(names[i]) for i in group[:8]) + (", ..." if len(group) > 8 else "")
            text = f"no sensor tells {listed} apart: they can change together without a trace in any measurement"
            cure = "measure one of them by itself, or remove one"
        yield Advice(places[first], text, cure, "unobservable")


def _unseen(tracks: Sequence[Track]) -> Array:
    """A basis (n, r) of the directions that leave no trace in any measurement of the track, in any mode."""
    stacked: list[Array] = []
    bounds: list[Array] = []  # of the same with absolute terms: what round-off is measured by
    for track in tracks:
        onward = absolute = np.eye(len(track.names))
        for k in range(len(track.size)):
            for name, H in track.H.items():
                size = np.sqrt(np.maximum(np.diag(track.R[name]), 0.0))
                size = np.where(size > 0, size, 1.0)[:, None]
                stacked.append(H[k] @ onward / size)
                bounds.append(np.abs(H[k]) @ absolute / size)
            onward, absolute = track.F[k] @ onward, np.abs(track.F[k]) @ absolute
            largest = np.abs(onward).max()
            if not np.isfinite(largest) or largest > 1e12:  # an unstable model: what is seen so far must do
                break
    rows, limits = np.vstack(stacked), np.vstack(bounds)
    finite = np.isfinite(limits).all(axis=1)
    length, limit = (np.sqrt((each[finite] ** 2).sum(axis=0)) for each in (rows, limits))
    rows = rows[finite]
    seen = length > 1e-13 * limit
    n = len(length)
    scaled = rows[:, seen] / length[seen]
    _, values, right = np.linalg.svd(scaled, full_matrices=scaled.shape[0] < scaled.shape[1])
    rank = int(np.count_nonzero(values > RANK * max(float(values.max(initial=0.0)), 1.0)))
    null = np.zeros((n, int(seen.sum()) - rank))
    null[seen] = right[rank:].T / length[seen][:, None]
    alone = np.eye(n)[:, ~seen]
    null /= np.maximum(np.abs(null).max(axis=0, initial=0.0), 1e-300)
    return np.hstack([alone, null])


def _groups(blind: Array) -> Iterator[list[int]]:
    """States that take part in directions which share some: of a basis reduced to as few states each as it can be."""
    rows = blind.T.copy()
    rank = 0
    for column in range(rows.shape[1]):
        left = rows[rank:, column]
        if not left.size or np.abs(left).max() < SHARE:
            continue
        pivot = rank + int(np.argmax(np.abs(left)))
        rows[[rank, pivot]] = rows[[pivot, rank]]
        rows[rank] /= rows[rank, column]
        for other in range(len(rows)):
            if other != rank:
                rows[other] -= rows[other, column] * rows[rank]
        rank += 1
    groups: list[set[int]] = []
    for row in rows[:rank]:
        group = {int(i) for i in np.flatnonzero(np.abs(row) > SHARE * np.abs(row).max())}
        for known in [g for g in groups if g & group]:
            groups.remove(known)
            group |= known
        groups.append(group)
    yield from sorted(map(sorted, groups))


def _known(tracks: Sequence[Track], i: int) -> bool:
    """A state that is known exactly and stays so: nothing is to be estimated of it."""
    return all(track.model.P0[i, i] == 0 and track.Q[i, i] == 0 for track in tracks)
