"""The circle: an angle, or anything else that repeats after a period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from kfgen.ir.trace import Value


@dataclass(frozen=True)
class Circle:
    """Numbers in (-period/2, period/2]; a [-] b is the shortest way from b to a.

    Where the derivatives exist, that is everywhere but half a turn apart, they are those of the line.
    """

    period: Any
    dimension = 1
    flat = False

    def placed(self, x: Any) -> Any:
        """x in its chart, by whole periods."""
        return _wrapped(x, self.period)

    def retract(self, x: Any, d: Any) -> Any:
        return _wrapped(x + d, self.period)

    def local(self, a: Any, b: Any) -> Any:
        return _wrapped(a - b, self.period)


def _wrapped(a: Any, period: Any) -> Any:
    """a in (-period/2, period/2]; a float that is not finite becomes NaN."""
    if isinstance(a, Value):
        return a.trace.wrap(a, period) if a.constant is None else a.trace.value(_wrapped(a.constant, period))
    if isinstance(a, Fraction):
        return a - (a / period - Fraction(1, 2)).__ceil__() * period
    if not math.isfinite(a):
        return math.nan
    rest = math.remainder(a, period)
    return 0.5 * period if rest == -0.5 * period else rest
