"""The form `sqrt`: the lower Cholesky factor."""

from __future__ import annotations

from kfgen.filters.covariance.forms import Choice
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.sqrt.loops import LoopedSqrt
from kfgen.filters.covariance.sqrt.straight import StraightSqrt


def straight(choice: Choice) -> StraightSqrt:
    return StraightSqrt(choice.n)


def looped(form: StraightSqrt, how: Looping) -> LoopedSqrt:
    return LoopedSqrt(form, how)
