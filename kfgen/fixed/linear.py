"""Whether the covariance of a filter is the same whatever is measured."""

from __future__ import annotations

from kfgen.filters.base import FilterCode
from kfgen.model import Model


def linear(code: FilterCode) -> bool:
    """Whether it is: a model of constant slopes and noises, which nothing adapts, and a step that is compiled in."""
    model, options = code.model, code.model.options
    every = model.every_options
    if code.modes or any(o.influence or o.inflation or o.adapt_R is not None for o in every):
        return False
    return model.dt is not None and options.adapt_Q is None and _constant(model)


def _constant(model: Model) -> bool:
    """Whether the slopes of f, h and residuals, and all noises, are numbers."""
    if model.definitions:
        return False
    curves = [*model.f, *(e for s in model.sensors for e in (*s.h, *(r for r in s.residual if r is not None)))]
    if any(slope.free_symbols for e in curves for _, slope in model.partials(e)):
        return False
    noises = [model.Q, model.noise_covariance]
    noises += [matrix for s in model.sensors for matrix in (s.R, s.noise_covariance)]
    return not any(e.free_symbols for matrix in noises for row in matrix for e in row)
