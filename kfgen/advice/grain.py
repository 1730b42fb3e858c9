"""How finely a float resolves the states along a track, beside their standard deviations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kfgen.advice.resolution import too_coarse, ulp

Array = NDArray[np.float64]


class Grain:
    """What a float's resolution is against the standard deviations along the track."""

    def __init__(self, names: list[str], compensated: tuple[str, ...]) -> None:
        self.names = names
        self._whole = np.array([name in compensated for name in names])  # what two floats hold
        self._x: list[Array] = []
        self._sigma: list[Array] = []

    def see(self, x: Array, P: Array) -> None:
        self._x.append(x)
        self._sigma.append(np.sqrt(np.maximum(np.diag(P), 0.0)))

    def coarse(self) -> tuple[str, ...]:
        """A sentence for each state that most rows resolve too coarsely."""
        x, sigma = np.abs(self._x), np.array(self._sigma)
        most = (too_coarse(x, sigma).mean(axis=0) > 0.5) & ~self._whole
        size, spread = np.median(x, axis=0), np.median(sigma, axis=0)
        return tuple(
            f"{self.names[i]}: float resolves {size[i]:.3g} to {ulp(size[i]):.2g}, beside a standard deviation of "
            f"{spread[i]:.2g}: count it from a local origin, or write scalar: double"
            for i in np.flatnonzero(most)
        )
