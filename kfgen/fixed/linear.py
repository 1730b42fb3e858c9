"""Whether the covariance of a filter is the same whatever is measured."""

from __future__ import annotations

from kfgen.filters.base import FilterCode
from kfgen.model import Model


def linear(code: FilterCode) -> bool:
    """Whether it is: a linear model of constant coefficients, whose noises nothing adapts."""
    model, options = code.model, code.model.options
    every = model.every_options
    if code.modes or any(o.influence or o.inflation or o.adapt_R is not None for o in every):
        return False
    if model.spec.filter.type != "kf" and not _constant(model):
        return False
    return model.dt is not None and options.adapt_Q is None and not model.definitions


def _constant(model: Model) -> bool:
    """Whether the slopes of f and h are numbers, or depend on dt alone, and the noises are numbers."""
    moving = {*model.symbols} - {"dt"}
    for e in (*model.f, *(h for s in model.sensors for h in s.h)):
        for _, slope in model.partials(e):
            if {s.name for s in slope.free_symbols} & moving:
                return False
    noisy = [e for row in model.Q for e in row] + [e for s in model.sensors for row in s.R for e in row]
    return not any(e.free_symbols for e in noisy)
