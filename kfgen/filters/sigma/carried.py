"""Which noise inputs a filter carries as dimensions of its sigma points, and in which geometry images differ.

Carried are noises that do not enter linearly. An image of a periodic entry that is linear in the periodic states, and
does not jump, is as good as a number: its points may spread over more than a period.
"""

from __future__ import annotations

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.sigma import cloud
from kfgen.filters.steps import process
from kfgen.geometry.line import Line
from kfgen.geometry.part import Part
from kfgen.ir.trace import Trace
from kfgen.model import Model
from kfgen.model.model import SensorModel


def by_process(model: Model) -> tuple[str, ...]:
    held = [w.name for w in model.noises if not w.density]
    index = [i for i, w in enumerate(model.noises) if not w.density]
    C = tuple(tuple(model.noise_covariance[i][j] for j in index) for i in index)
    return cloud.carried_by(model, _step(model), held, C, model.spec.filter.augment)


def by_sensor(model: Model, sensor: SensorModel) -> tuple[str, ...]:
    names = [w.name for w in sensor.noises]
    if not names:
        return ()
    return cloud.carried_by(model, _seen(model, sensor), names, sensor.noise_covariance, model.spec.filter.augment)


def images_of_process(model: Model) -> tuple[Part, ...]:
    """The geometry of each state as f leaves it."""
    if all(part.flat for part in model.parts):
        return model.parts
    return _images(model, _step(model), model.parts)


def images_of_sensor(model: Model, sensor: SensorModel) -> tuple[Part, ...]:
    """The geometry of each component as h leaves it."""
    if all(part.flat for part in sensor.parts):
        return sensor.parts
    return _images(model, _seen(model, sensor), sensor.parts)


def _images(model: Model, after: list[Dual], parts: tuple[Part, ...]) -> tuple[Part, ...]:
    turning = [name for name, part in zip(model.states, model.parts, strict=True) if not part.flat]
    return tuple(
        Line() if cloud.passes(dual, turning) else part for dual, part in zip(after, parts, strict=True)
    )  # fmt: skip


def _step(model: Model) -> list[Dual]:
    """The states after a step, by x and the noises per step."""
    t = Trace()
    held = [w.name for w in model.noises if not w.density]
    step = process.step_length(t, model)
    prior = process.given(t, model, step)
    duals = {**prior.duals, **cloud.symbolic_noises(t, held)}
    return process.advance(t, model, process.Prior(prior.x, duals), step).after


def _seen(model: Model, sensor: SensorModel) -> list[Dual]:
    """h by x and the sensor's noises."""
    t = Trace()
    used = model.uses(*sensor.h)
    x = {name: Dual(t.element("kf.x", i), {name: t.one}) for i, name in enumerate(model.states)}
    noises = cloud.symbolic_noises(t, [w.name for w in sensor.noises])
    duals = {**x, **noises, **process.parameters_and_inputs(t, model, sensor=sensor)}
    if "t" in used:
        duals["t"] = process.time_now(t, model)
    if model.dt is not None:
        duals["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, duals)
    return [evaluator(e) for e in sensor.h]
