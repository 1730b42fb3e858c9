"""The form `ud`: U D U^T."""

from __future__ import annotations

from kfgen.filters.covariance.forms import Choice
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.ud.loops import LoopedUD
from kfgen.filters.covariance.ud.straight import StraightUD


def straight(choice: Choice) -> StraightUD:
    return StraightUD(choice.order, choice.update or "bierman", choice.change(choice.order))


def looped(form: StraightUD, how: Looping) -> LoopedUD:
    return LoopedUD(form, how)
