"""Which noise inputs a filter carries as dimensions of its sigma points, and in which geometry images differ.

Carried are noises that do not enter linearly. An image of a periodic entry that is linear in the periodic states, and
does not jump, is as good as a number: its points may spread over more than a period.
"""

from __future__ import annotations

from kfgen.filters.algebra.dual import Dual, Evaluator, held_attitudes, state_seeds
from kfgen.filters.sigma import cloud
from kfgen.filters.steps import process
from kfgen.geometry.line import Line
from kfgen.geometry.part import Part
from kfgen.geometry.rotation import Rotation
from kfgen.geometry.space import Space
from kfgen.ir.trace import Trace
from kfgen.model import Model
from kfgen.model.model import SensorModel


def by_process(model: Model) -> tuple[str, ...]:
    held = [w.name for w in model.noises if not w.density]
    index = [i for i, w in enumerate(model.noises) if not w.density]
    C = tuple(tuple(model.noise_covariance[i][j] for j in index) for i in index)
    return cloud.carried_by(model, _step(model, turning=False), held, C, model.spec.filter.augment)


def by_sensor(model: Model, sensor: SensorModel) -> tuple[str, ...]:
    names = [w.name for w in sensor.noises]
    if not names:
        return ()
    seen = _seen(model, sensor, turning=False)
    return cloud.carried_by(model, seen, names, sensor.noise_covariance, model.spec.filter.augment)


def images_of_process(model: Model) -> Space:
    """The geometry of the state as f leaves it."""
    return model.space if model.space.flat else _images(model, _step(model), model.space)


def images_of_sensor(model: Model, sensor: SensorModel) -> Space:
    """The geometry of the components as h leaves them."""
    return sensor.space if sensor.space.flat else _images(model, _seen(model, sensor), sensor.space)


def _images(model: Model, after: list[Dual], space: Space) -> Space:
    turning = [model.errors[j] for _, j, part in model.space.singles if not part.flat]
    parts: dict[int, Part | Rotation] = {
        i: Line() if cloud.passes(after[i], turning) else part for i, _, part in space.singles
    }
    parts |= {i: rotation for i, _, rotation in space.rotations}
    return Space(tuple(parts[i] for i in sorted(parts)))


def _step(model: Model, turning: bool = True) -> list[Dual]:
    """The states after a step, by x and the noises per step; the rates of rotations beside them where these are not to
    turn."""
    t = Trace()
    held = [w.name for w in model.noises if not w.density]
    step = process.step_length(t, model)
    prior = process.given(t, model, step)
    duals = {**prior.duals, **cloud.symbolic_noises(t, held)}
    if turning or not model.rotations:
        return process.advance(t, model, process.Prior(prior.x, duals), step).after
    still = {**duals, **held_attitudes(t, model)}
    after = process.advance(t, model, process.Prior(prior.x, still), step).after
    if model.spec.dynamics.form != "discrete":
        return after
    evaluator = Evaluator(t, model, duals)
    turns = [evaluator(e) for turn in model.turns for e in turn or ()]
    # what a new quaternion is made of is not linear in its noise
    bent = [Dual(d.value, {w: g * t.element("kf.x", 0) for w, g in d.gradient.items()}) for d in turns]
    return [*after, *bent]


def _seen(model: Model, sensor: SensorModel, turning: bool = True) -> list[Dual]:
    """h by x and the sensor's noises. turning: whether the attitude counts as a state."""
    t = Trace()
    used = model.uses(*sensor.h)
    x = state_seeds(t, model, [t.element("kf.x", i) for i in range(len(model.states))])
    if not turning:
        x |= held_attitudes(t, model)
    noises = cloud.symbolic_noises(t, [w.name for w in sensor.noises])
    duals = {**x, **noises, **process.parameters_and_inputs(t, model, sensor=sensor)}
    if "t" in used:
        duals["t"] = process.time_now(t, model)
    if model.dt is not None:
        duals["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, duals)
    return [evaluator(e) for e in sensor.h]
