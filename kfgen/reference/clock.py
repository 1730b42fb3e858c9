"""Seconds since init, as the filter keeps them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction


@dataclass(frozen=True)
class Clock:
    """A step count where the step is fixed (exact), else a compensated sum (Kahan 1965).

    step: the fixed step in s, or None. Without any dt the clock counts steps.
    """

    step: Fraction | None = None
    count: int = 0
    total: float = 0.0
    lost: float = 0.0

    @property
    def now(self) -> float:
        """t in s."""
        return self.total if self.step is None else float(self.count * self.step)

    def advanced(self, dt: float) -> Clock:
        """The clock one step of dt seconds later (dt is not looked at where the step is fixed)."""
        if self.step is not None:
            return replace(self, count=self.count + 1)
        term = dt - self.lost
        total = self.total + term
        return replace(self, count=self.count + 1, total=total, lost=(total - self.total) - term)
