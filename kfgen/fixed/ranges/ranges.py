"""The largest and smallest values that runs have met, cell by cell and node by node."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

HUGE = 1e30  # what is beyond has left the model

Met = tuple[tuple[list[float], list[float], list[float]], list[int]]


@dataclass
class Ranges:
    """high, low: the largest and smallest value (at least 0, at most 0); small: the smallest size that is not 0."""

    index: dict[Any, int] = field(default_factory=dict)
    high: list[float] = field(default_factory=list)
    low: list[float] = field(default_factory=list)
    small: list[float] = field(default_factory=list)
    quotients: dict[tuple[str, str], list[float]] = field(default_factory=dict)  # function, local -> all its values

    def slot(self, key: Any) -> int:
        """The place of a cell or of a node."""
        found = self.index.get(key)
        if found is None:
            found = self.index[key] = len(self.high)
            self.high.append(0.0)
            self.low.append(0.0)
            self.small.append(HUGE)
        return found

    def see(self, key: Any, value: float) -> None:
        self.meet(self.slot(key), value)

    def meet(self, slot: int, value: float) -> None:
        """The same by its place."""
        if value > self.high[slot]:
            if value < math.inf:
                self.high[slot] = value
        elif -math.inf < value < self.low[slot]:
            self.low[slot] = value

    def copy(self) -> Met:
        """What has been met so far; for `restore`."""
        return (list(self.high), list(self.low), list(self.small)), [len(v) for v in self.quotients.values()]

    def restore(self, met: Met) -> None:
        """Forget what has been met since."""
        seen, lengths = met
        for values, old, blank in zip((self.high, self.low, self.small), seen, (0.0, 0.0, HUGE), strict=True):
            values[:] = old + [blank] * (len(values) - len(old))
        for values, length in zip(self.quotients.values(), lengths, strict=False):
            del values[length:]

    def largest(self, key: Any) -> float:
        """The largest size met, 0 where nothing was."""
        i = self.index.get(key)
        return 0.0 if i is None else max(self.high[i], -self.low[i])

    def spread(self, function: str, name: str) -> float:
        """By how much the largest size of a quotient exceeds its usual one; 0 where it was never made."""
        sizes = sorted(abs(v) for v in self.quotients.get((function, name), []) if v and math.isfinite(v))
        return sizes[-1] / sizes[len(sizes) // 2] if sizes else 0.0

    def smallest(self, key: Any) -> float:
        i = self.index.get(key)
        return 0.0 if i is None or self.small[i] >= HUGE else self.small[i]
