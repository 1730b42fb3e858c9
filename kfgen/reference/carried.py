"""Which noise inputs a sigma-point filter carries as dimensions of its points.

A noise that only shifts the result by a constant multiple of itself is as well served by G Qw G^T. Carried are
those by which the derivative contains states or noises, and what is correlated with them. That is decided by
the structure of the formulas, definitions and integrator included, never by values: `where(a, x*w, w)` contains
x, and so does `(x + 1)*w - x*w`, which nothing here simplifies. What is constant is folded, 0*x*w vanishes.
Noises given by a density are not carried: they have no value to hold over a step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from kfgen.errors import NOWHERE
from kfgen.reference.model import Model
from kfgen.spec.tree import Call, Expression, Name, Tree
from kfgen.spec.types import Matrix, Noise, Sensor

Names = frozenset[str]
_NONE: Names = frozenset()


@dataclass(frozen=True)
class Shape:
    """What a formula contains, states and noises only.

    names: those in it. slopes: noise -> those in its derivative by that noise; a noise is absent where this
    derivative is 0.
    """

    names: Names = _NONE
    slopes: Mapping[str, Names] = field(default_factory=dict)


CONSTANT = Shape()


def carried_by_process(model: Model) -> tuple[str, ...]:
    """The carried noises per step of the dynamics, in the spec's order."""
    spec = model.spec
    held = [noise.name for noise in spec.noise if not noise.density]
    if spec.filter.augment:
        return tuple(held)
    after = _Formulas(model, held).step()
    bent = {noise for shape in after.values() for noise, names in shape.slopes.items() if names}
    return _with_correlated(model, bent, spec.noise, spec.noise_covariance)


def carried_by_sensor(model: Model, sensor: Sensor) -> tuple[str, ...]:
    """The carried noise inputs of a sensor, in the spec's order; the same ones under every mask."""
    names = [noise.name for noise in sensor.noise]
    if model.spec.filter.augment:
        return tuple(names)
    formulas = _Formulas(model, names)
    point = formulas.point()
    shapes = [formulas.shape(component.h.tree, point) for component in sensor.components]
    bent = {noise for shape in shapes for noise, contained in shape.slopes.items() if contained}
    return _with_correlated(model, bent, sensor.noise, sensor.noise_covariance)


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


class _Formulas:
    """Formulas over the states and some noises; every other name is a constant to them."""

    def __init__(self, model: Model, noises: Sequence[str]) -> None:
        self.model, self.noises = model, noises
        self.definitions = {definition.name: definition.value.tree for definition in model.spec.let}

    def point(self) -> dict[str, Shape]:
        """The shapes of the states and noises themselves."""
        shapes = {name: Shape(frozenset({name})) for name in self.model.states}
        return shapes | {name: Shape(frozenset({name}), {name: _NONE}) for name in self.noises}

    def step(self) -> dict[str, Shape]:
        """The states after a step, in terms of those before it and of the noises."""
        dynamics = self.model.spec.dynamics
        x = self.point()
        if dynamics.form != "continuous":
            return self._f(x, {name: x[name] for name in self.model.states})
        if dynamics.integrator == "exact":
            # linear in the states: the step has of the noises what the rate has
            return _along(x, self._rate(x))
        for _ in range(dynamics.substeps):
            after = x | _INTEGRATORS[dynamics.integrator](self._rate, x)
            if after == x:
                break
            x = after
        return {name: x[name] for name in self.model.states}

    def _rate(self, x: dict[str, Shape]) -> dict[str, Shape]:
        return self._f(x, dict.fromkeys(self.model.states, CONSTANT))

    def _f(self, x: dict[str, Shape], otherwise: Mapping[str, Shape]) -> dict[str, Shape]:
        """f at x; `otherwise` for states without a formula."""
        f, known = self.model.spec.dynamics.f, dict(x)
        return {name: self.shape(f[name].tree, known) if name in f else otherwise[name] for name in self.model.states}

    def shape(self, tree: Tree, known: dict[str, Shape]) -> Shape:
        """The shape of a formula; `known` are the shapes of names, to which those of definitions are added."""
        if isinstance(tree, Name):
            if tree.name not in known and tree.name in self.definitions:
                known[tree.name] = self.shape(self.definitions[tree.name], known)
            return known.get(tree.name, CONSTANT)
        if not isinstance(tree, Call):
            return CONSTANT
        parts = [self.shape(argument, known) for argument in tree.args]
        if not any(part.names for part in parts):
            return CONSTANT
        if tree.op == "mul" and any(self._is(argument, 0) for argument in tree.args):
            return CONSTANT
        if tree.op == "div" and self._is(tree.args[0], 0):
            return CONSTANT
        if tree.op == "pow" and self._is(tree.args[1], 0):
            return CONSTANT
        if tree.op == "pow" and self._is(tree.args[1], 1):
            return parts[0]
        return _RULES.get(tree.op, _bent)(*parts)

    def _is(self, tree: Tree, number: int) -> bool:
        return self.model.scope.constant(Expression(tree, "", NOWHERE)) == number


def _sum(*parts: Shape) -> Shape:
    slopes: dict[str, Names] = {}
    for part in parts:
        for noise, names in part.slopes.items():
            slopes[noise] = slopes.get(noise, _NONE) | names
    return Shape(frozenset().union(*(part.names for part in parts)), slopes)


def _product(a: Shape, b: Shape) -> Shape:
    """d(ab) = da b + a db."""
    both = _sum(a, b)
    slopes = dict(both.slopes)
    for factor, other in ((a, b), (b, a)):
        for noise in factor.slopes:
            slopes[noise] = slopes[noise] | other.names
    return Shape(both.names, slopes)


def _quotient(a: Shape, b: Shape) -> Shape:
    return _product(a, _bent(b))


def _bent(*parts: Shape) -> Shape:
    """A function whose derivatives contain all that it contains."""
    both = _sum(*parts)
    return Shape(both.names, dict.fromkeys(both.slopes, both.names))


def _selected(condition: Shape, a: Shape, b: Shape) -> Shape:
    """d where(c, a, b) = where(c, da, db)."""
    both = _sum(a, b)
    return Shape(both.names | condition.names, {noise: names | condition.names for noise, names in both.slopes.items()})


def _flat(*parts: Shape) -> Shape:
    """Steps: their derivative is 0."""
    return Shape(_sum(*parts).names)


def _table(x: Shape, *points: Shape) -> Shape:
    """Piecewise linear in x, and linear in the heights with coefficients that contain x."""
    heights = _sum(*points)
    slopes = {noise: names | x.names for noise, names in heights.slopes.items()}
    return _sum(Shape(heights.names, slopes), _bent(Shape(x.names | heights.names, x.slopes)))


_RULES: dict[str, Callable[..., Shape]] = {
    "add": _sum, "sub": _sum, "neg": _sum, "mul": _product, "div": _quotient, "where": _selected, "table": _table,
    "sign": _flat, "floor": _flat, "lt": _flat, "le": _flat, "gt": _flat, "ge": _flat, "and": _flat, "or": _flat,
    "not": _flat,
}  # fmt: skip


Shapes = dict[str, Shape]


def _along(x: Shapes, k: Shapes) -> Shapes:
    """x + h k, of the states."""
    return x | {name: _sum(x[name], slope) for name, slope in k.items()}


def _euler(f: Callable[[Shapes], Shapes], x: Shapes) -> Shapes:
    return _along(x, f(x))


def _midpoint(f: Callable[[Shapes], Shapes], x: Shapes) -> Shapes:
    return _along(x, f(_along(x, f(x))))


def _rk4(f: Callable[[Shapes], Shapes], x: Shapes) -> Shapes:
    k1 = f(x)
    k2 = f(_along(x, k1))
    k3 = f(_along(x, k2))
    k4 = f(_along(x, k3))
    return _along(_along(_along(_along(x, k1), k2), k3), k4)


_INTEGRATORS = {"euler": _euler, "midpoint": _midpoint, "rk4": _rk4}
