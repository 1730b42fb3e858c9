"""The time step, and seconds since init as the filter keeps them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

from kfgen.reference.status import Status, StepError
from kfgen.spec.tree import Expression
from kfgen.spec.types import Spec


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


@dataclass(frozen=True)
class Step:
    """The bounds of a run-time step in s; None where it has none."""

    run_time: bool
    nominal: float
    minimum: float | None = None
    maximum: float | None = None

    def clamped(self, dt: float) -> tuple[float, Status]:
        """dt within its bounds, and DT_CLAMPED where that changed it. Raises StepError NOT_POSITIVE."""
        if self.minimum is not None and dt < self.minimum:
            return self.minimum, Status.DT_CLAMPED
        if self.minimum is None and dt <= 0.0:
            raise StepError(Status.NOT_POSITIVE)
        if self.maximum is not None and dt > self.maximum:
            return self.maximum, Status.DT_CLAMPED
        return dt, Status.OK


def step_of(spec: Spec, number: Callable[[Expression], float]) -> Step:
    """The step of a spec; number gives an expression's value."""
    dt = spec.dt
    if dt is None:
        return Step(False, 1.0)
    bounds = [None if bound is None else number(bound) for bound in (dt.minimum, dt.maximum)]
    return Step(dt.run_time, number(dt.nominal), *bounds)
