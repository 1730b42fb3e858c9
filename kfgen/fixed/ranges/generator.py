"""Random numbers of kfgen's own: the same on every machine and with every version of numpy."""

from __future__ import annotations

_MASK = (1 << 64) - 1


class Random:
    """A generator (splitmix64; Steele, Lea & Flood 2014).

    gain: factor of every normal number. outliers: the share of them that is ten times as large again.
    """

    def __init__(self, seed: int, gain: float = 1.0, outliers: float = 0.0) -> None:
        self._state = (seed * 0x9E3779B97F4A7C15 + 0x1234567) & _MASK
        self.gain = gain
        self.outliers = outliers

    def random(self) -> float:
        """Uniform in [0, 1)."""
        self._state = (self._state + 0x9E3779B97F4A7C15) & _MASK
        z = self._state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
        return ((z ^ (z >> 31)) >> 11) * 2.0**-53

    def standard_normal(self, size: int) -> list[float]:
        return [self._normal() for _ in range(size)]

    def _normal(self) -> float:
        value = sum(self.random() for _ in range(12)) - 6.0  # close to normal, and without a logarithm
        far = self.outliers > 0 and self.random() < self.outliers
        return value * self.gain * (10.0 if far else 1.0)
