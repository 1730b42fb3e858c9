"""Influence functions: how far an innovation is believed (Huber 1964; Fahrmeir & Kaufmann 1991).

A robust update takes sigma psi(e) for the innovation nu = sigma e, with sigma^2 the measurement's variance, and
weighs the information it brings by psi'(e).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from kfgen.reference.dual import jacobian, value_of, variables
from kfgen.reference.evaluate import renamed
from kfgen.reference.model import INNOVATION, Context, Model
from kfgen.reference.status import Status, StepError
from kfgen.spec.types import Robust

# a normalised innovation e -> psi(e) and its weight g = psi'(e) >= 0
Influence = Callable[[float], tuple[float, float]]


def influence(model: Model, robust: Robust) -> Callable[[Context], Influence]:
    """The influence function of a spec, whose formulas may use run-time parameters."""
    if robust.influence == "chernodarov":
        return lambda context: chernodarov
    if robust.influence == "huber":
        assert robust.k is not None
        huber = _huber(model.number(robust.k))
        return lambda context: huber
    return _custom(model, robust)


def chernodarov(e: float) -> tuple[float, float]:
    """Believed up to 3, to a third up to 6, and a sign beyond."""
    if abs(e) <= 3.0:
        return e, 1.0
    if abs(e) <= 6.0:
        return e / 3.0, 1.0 / 3.0
    return math.copysign(1.0, e), 0.0


def _huber(k: float) -> Influence:
    """Clipped at +-k (Huber 1964)."""

    def clipped(e: float) -> tuple[float, float]:
        return (e, 1.0) if abs(e) <= k else (math.copysign(k, e), 0.0)

    return clipped


def _custom(model: Model, robust: Robust) -> Callable[[Context], Influence]:
    """Formulas in `e`, which here is the normalised innovation and not Euler's number.

    Without a formula of its own the derivative is that of psi; below 0 it is taken for 0.
    """
    assert robust.psi is not None
    hidden = {"e": INNOVATION}
    psi = model.scope.compile(renamed(robust.psi.tree, hidden))
    psi_dot = None if robust.psi_dot is None else model.scope.compile(renamed(robust.psi_dot.tree, hidden))
    slot = model.scope.slots[INNOVATION]

    def at(context: Context) -> Influence:
        def evaluated(e: float) -> tuple[float, float]:
            environment = model.environment(context, model.x0)
            (environment[slot],) = variables([e])
            result = psi(environment)
            value = value_of(result)
            slope = jacobian([result], 1)[0, 0] if psi_dot is None else value_of(psi_dot(environment))
            if not (math.isfinite(value) and math.isfinite(slope)):
                raise StepError(Status.NOT_FINITE)
            return value, max(float(slope), 0.0)

        return evaluated

    return at
