"""The form `full`: the upper triangle of P."""

from __future__ import annotations

from kfgen.filters.covariance.forms import Choice
from kfgen.filters.covariance.full.loops import LoopedFull
from kfgen.filters.covariance.full.straight import StraightFull
from kfgen.filters.covariance.loops.looped import Looping


def straight(choice: Choice) -> StraightFull:
    change = choice.change(list(range(choice.n)))
    return StraightFull(choice.n, choice.update or "standard", choice.epsilon, choice.order, change, choice.coarse)


def looped(form: StraightFull, how: Looping) -> LoopedFull:
    return LoopedFull(form, how)
