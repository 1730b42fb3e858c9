"""Which noise inputs a filter carries as dimensions of its sigma points: those that do not enter linearly."""

from __future__ import annotations

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.sigma import cloud
from kfgen.filters.steps import process
from kfgen.ir.trace import Trace
from kfgen.model import Model
from kfgen.model.model import SensorModel


def by_process(model: Model) -> tuple[str, ...]:
    t = Trace()
    held = [w.name for w in model.noises if not w.density]
    step = process.step_length(t, model)
    prior = process.given(t, model, step)
    duals = {**prior.duals, **cloud.symbolic_noises(t, held)}
    result = process.advance(t, model, process.Prior(prior.x, duals), step)
    index = [i for i, w in enumerate(model.noises) if not w.density]
    C = tuple(tuple(model.noise_covariance[i][j] for j in index) for i in index)
    return cloud.carried_by(model, result.after, held, C, model.spec.filter.augment)


def by_sensor(model: Model, sensor: SensorModel) -> tuple[str, ...]:
    names = [w.name for w in sensor.noises]
    if not names:
        return ()
    t = Trace()
    used = model.uses(*sensor.h)
    x = {name: Dual(t.element("kf.x", i), {name: t.one}) for i, name in enumerate(model.states)}
    duals = {**x, **cloud.symbolic_noises(t, names), **process.parameters_and_inputs(t, model)}
    if "t" in used:
        duals["t"] = process.time_now(t, model)
    if model.dt is not None:
        duals["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, duals)
    after = [evaluator(e) for e in sensor.h]
    return cloud.carried_by(model, after, names, sensor.noise_covariance, model.spec.filter.augment)
