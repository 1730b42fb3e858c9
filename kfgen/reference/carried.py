"""Which noise inputs a sigma-point filter carries as dimensions of its points, and which images it wraps.

A noise that only shifts the result by a constant multiple of itself is as well served by G Qw G^T. Carried are
those by which the derivative contains states or noises, and what is correlated with them. The attitude is none of these
states where a noise enters only as rotate(q, w), or in a quaternion's rate. Noises given by a density are not carried:
they have no value to hold over a step.

An image that is linear in the periodic states and does not jump is not wrapped: its spread may exceed a period.
Both are decided by the structure of the formulas: see `shapes`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from kfgen.reference.model import Model
from kfgen.reference.shapes import Formulas, Shape
from kfgen.spec.types import Matrix, Noise, Sensor


def carried_by_process(model: Model) -> tuple[str, ...]:
    """The carried noises per step of the dynamics, in the spec's order."""
    spec = model.spec
    held = [noise.name for noise in spec.noise if not noise.density]
    if spec.filter.augment:
        return tuple(held)
    bent = _bent(Formulas(model, held, turning=False).step().values())
    return _with_correlated(model, bent, spec.noise, spec.noise_covariance)


def carried_by_sensor(model: Model, sensor: Sensor) -> tuple[str, ...]:
    """The carried noise inputs of a sensor, in the spec's order; the same ones under every mask."""
    names = [noise.name for noise in sensor.noise]
    if model.spec.filter.augment:
        return tuple(names)
    bent = _bent(_predicted(model, sensor, turning=False))
    return _with_correlated(model, bent, sensor.noise, sensor.noise_covariance)


def wrapped_by_process(model: Model) -> tuple[int, ...]:
    """The periodic states (their indices in P) whose images have to be wrapped."""
    held = [noise.name for noise in model.spec.noise if not noise.density]
    after = Formulas(model, held).step()
    return tuple(i for i in model.turns if _turns(model, after[model.errors[i]]))


def wrapped_by_sensor(model: Model, sensor: Sensor) -> tuple[int, ...]:
    """The components whose images have to be wrapped, if they are periodic."""
    return tuple(i for i, shape in enumerate(_predicted(model, sensor)) if _turns(model, shape))


def _turns(model: Model, shape: Shape) -> bool:
    """Whether a formula jumps, or is not linear in the periodic states."""
    return shape.jumps or any(shape.slopes.get(model.states[i]) for i in model.periods)


def _predicted(model: Model, sensor: Sensor, turning: bool = True) -> list[Shape]:
    """The shapes of the components of a sensor."""
    formulas = Formulas(model, [noise.name for noise in sensor.noise], turning)
    point = formulas.point()
    return [formulas.shape(component.h.tree, point) for component in sensor.components]


def _bent(shapes: Iterable[Shape]) -> set[str]:
    """The variables by which some derivative contains others or themselves."""
    return {variable for shape in shapes for variable, names in shape.slopes.items() if names}


def _with_correlated(
    model: Model, bent: set[str], noises: Sequence[Noise], covariance: Matrix | None
) -> tuple[str, ...]:
    """The noises `bent` and all that are correlated with them, directly or through others."""
    names, found = [noise.name for noise in noises], set(bent)
    for _ in names:
        for i, row in enumerate(covariance or ()):
            if names[i] in found:
                found |= {names[j] for j, entry in enumerate(row) if model.scope.constant(entry) != 0}
    return tuple(name for name in names if name in found)
