"""What the sensors tell of the state at the start, along a track: singular values of the observability matrix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNSEEN = 1e-9  # of the longest column: below it a state might as well not be there
RANK = 1e-10  # of columns of unit length: below it a singular value is round-off


@dataclass(frozen=True)
class Observability:
    """values: singular values (n), the largest first, of the stacked H F...F, in units of noise for a deviation of one
    standard deviation of the start. rank: how many are not round-off. weakest: state -> share of the direction that is
    seen least, squared, in the same units; they sum to 1."""

    values: tuple[float, ...]
    rank: int
    weakest: Mapping[str, float]

    def as_json(self) -> dict[str, object]:
        return {"rank": self.rank, "weakest": dict(self.weakest), "singular_values": list(self.values)}


def observability(stacked: Sequence[Array], sigma: Array, names: Sequence[str]) -> Observability:
    """Of stacked rows [k, n]; sigma (n): the start's standard deviations, each state's unit (1 where that is 0)."""
    n = len(names)
    unit = np.where(sigma > 0, sigma, 1.0)
    rows = np.vstack([*stacked, np.zeros((n, n))]) * unit
    length = np.sqrt((rows**2).sum(axis=0))
    seen = length > UNSEEN * float(length.max())
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    alike = np.linalg.svd(rows[:, seen] / length[seen], compute_uv=False) if seen.any() else np.zeros(0)
    rank = int(np.count_nonzero(alike > RANK * max(float(alike.max(initial=0.0)), 1.0)))
    weakest = right[-1] ** 2 if seen.all() else np.where(seen, 0.0, 1.0 / max(int((~seen).sum()), 1))
    weakest = weakest / weakest.sum()
    shares = {name: float(w) for name, w in zip(names, weakest, strict=True) if w > 1e-6}
    return Observability(tuple(map(float, values)), rank, shares)
