"""The options of a spec's filter that act on each scalar measurement."""

from __future__ import annotations

import math
from dataclasses import replace

from kfgen.reference.chi2 import chi2_quantile
from kfgen.reference.influence import influence
from kfgen.reference.joseph import PLAIN, Rules
from kfgen.reference.model import Context, Model
from kfgen.spec.types import Adaptive

# the probability of the chi-square test of `adaptive`, alone and beside `robust`
_ALONE, _ROBUST = 0.999, 0.997


class Treatment:
    """How updates of a spec treat scalar measurements.

    Attributes: plain: the rules by which nis and the gate judge, which know the floor only. trivial: whether
    every update is made by these.
    """

    def __init__(self, model: Model) -> None:
        options = model.spec.filter
        self._influence = None if options.robust is None else influence(model, options.robust)
        floor = 0.0 if options.innovation_floor is None else model.number(options.innovation_floor)
        self.plain = replace(PLAIN, floor=floor)
        self._rules = replace(
            self.plain,
            chi2=None if options.adaptive is None else _threshold(model, options.adaptive, options.robust is not None),
            limit=math.inf if options.gain_limit is None else model.number(options.gain_limit),
            consider=tuple(model.row[name] for name in options.consider),
            one_by_one=options.adapt_Q is not None,
        )
        self.trivial = self._influence is None and self._rules == self.plain

    def rules(self, context: Context) -> Rules:
        """The rules of an update as made."""
        return self._rules if self._influence is None else replace(self._rules, influence=self._influence(context))


def _threshold(model: Model, adaptive: Adaptive, robust: bool) -> float:
    """The chi-square quantile that nu^2 / s is held against, for one scalar."""
    if adaptive.chi2 is not None:
        return model.number(adaptive.chi2)
    default = _ROBUST if robust else _ALONE
    return chi2_quantile(default if adaptive.probability is None else model.number(adaptive.probability), 1)
