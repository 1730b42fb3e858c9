"""Random numbers of kfgen's own: the same on every machine and with every version of numpy."""

from __future__ import annotations

import numpy as np

_MASK = (1 << 64) - 1
_STEP = 0x9E3779B97F4A7C15
_MOST = 4096  # numbers that are made ahead
_TERMS = 12  # of a sum that is close to normal, and without a logarithm


class Random:
    """A generator (splitmix64; Steele, Lea & Flood 2014).

    gain: factor of every normal number. outliers: the share of them that is ten times as large again.
    """

    def __init__(self, seed: int, gain: float = 1.0, outliers: float = 0.0) -> None:
        self._state = (seed * _STEP + 0x1234567) & _MASK
        self._ahead: list[float] = []
        self._at = 0
        self.gain = gain
        self.outliers = outliers

    def random(self) -> float:
        """Uniform in [0, 1)."""
        (value,) = self._next(1)
        return value

    def standard_normal(self, size: int) -> list[float]:
        gain, outliers = self.gain, self.outliers
        if outliers <= 0:
            terms = self._next(_TERMS * size)
            return [(sum(terms[i : i + _TERMS]) - 6.0) * gain for i in range(0, len(terms), _TERMS)]
        terms = self._next((_TERMS + 1) * size)
        return [
            (sum(terms[i : i + _TERMS]) - 6.0) * gain * (10.0 if terms[i + _TERMS] < outliers else 1.0)
            for i in range(0, len(terms), _TERMS + 1)
        ]

    def _next(self, count: int) -> list[float]:
        start, self._at = self._at, self._at + count
        while self._at > len(self._ahead):
            made = min(_MOST, max(64, 2 * len(self._ahead)))
            self._ahead = self._ahead[start:] + self._made(made)
            start, self._at = 0, count
        return self._ahead[start : self._at]

    def _made(self, count: int) -> list[float]:
        z = np.uint64(self._state) + np.uint64(_STEP) * np.arange(1, count + 1, dtype=np.uint64)
        self._state = int(z[-1])
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        numbers: list[float] = (((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53).tolist()
        return numbers
