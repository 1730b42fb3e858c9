"""What a factored covariance need not care about: it is positive semidefinite whatever rounding does."""

from __future__ import annotations

from fractions import Fraction
from typing import TypeVar

from kfgen.ir.trace import Trace, Value

P = TypeVar("P")


class Definite:
    """See Form."""

    def bounded(self, t: Trace, P: P, prior: P, share: Value, tolerance: Fraction) -> tuple[P, Value]:
        return P, t.wrapped(t.pool.boolean(False))

    def loosen(self, t: Trace) -> None:
        """Nothing: it is a square, or has factors that are not negative."""

    def limit_correlations(self, t: Trace) -> None:
        return
