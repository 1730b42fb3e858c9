"""What formulas contain, and what their derivatives do: decided by their structure, never by values.

`where(a, x*w, w)` contains x, and so does `(x + 1)*w - x*w`, which nothing here simplifies. Definitions and the
integrator are seen through. What is constant is folded, 0*x*w vanishes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from kfgen.errors import NOWHERE
from kfgen.reference.model import Model
from kfgen.spec.tree import Call, Expression, Name, Tree

Names = frozenset[str]
_NONE: Names = frozenset()


@dataclass(frozen=True)
class Shape:
    """What a formula contains, states and noises only.

    names: those in it. slopes: variable -> those in its derivative by that variable; a variable is absent where this
    derivative is 0. jumps: whether it may jump where they move on, as atan2 does from pi to -pi.
    """

    names: Names = _NONE
    slopes: Mapping[str, Names] = field(default_factory=dict)
    jumps: bool = False


CONSTANT = Shape()

Shapes = dict[str, Shape]


class Formulas:
    """Formulas over the states and some noises; every other name is a constant to them.

    turning: whether the attitude counts as one, in the matrices of quaternion states and in what their rates make of
    them: then a noise that enters as rotate(q, w), or in the rate of q, does so with a constant factor.
    """

    def __init__(self, model: Model, noises: Sequence[str], turning: bool = True) -> None:
        self.model, self.variables = model, (*model.states, *noises)
        self.turning = turning
        self._attitude = frozenset(part for rotation in model.spec.rotations for part in rotation.parts)
        self.definitions = {definition.name: definition.value.tree for definition in model.spec.let}

    def point(self) -> dict[str, Shape]:
        """The shapes of the states and noises themselves."""
        return {name: Shape(frozenset({name}), {name: _NONE}) for name in self.variables}

    def step(self) -> dict[str, Shape]:
        """The states after a step, in terms of those before it and of the noises."""
        dynamics = self.model.spec.dynamics
        x = self.point()
        if dynamics.form != "continuous":
            return self._f(x, {name: x[name] for name in self.model.states})
        if dynamics.integrator == "exact":
            # linear in the states: the step has of the noises what the rate has
            return self._along(x, self._rate(x))
        for _ in range(dynamics.substeps):
            after = x | self._integrated(dynamics.integrator, x)
            if after == x:
                break
            x = after
        return {name: x[name] for name in self.model.states}

    def _rate(self, x: dict[str, Shape]) -> dict[str, Shape]:
        return self._f(x, dict.fromkeys(self.model.errors, CONSTANT))

    def _f(self, x: dict[str, Shape], otherwise: Mapping[str, Shape]) -> dict[str, Shape]:
        """f at x; `otherwise` for what has no formula."""
        f, known = self.model.spec.dynamics.f, dict(x)
        return {name: self.shape(f[name].tree, known) if name in f else otherwise[name] for name in otherwise}

    def _integrated(self, integrator: str, x: Shapes) -> Shapes:
        k = [self._rate(x)]
        if integrator != "euler":
            k.append(self._rate(self._along(x, k[0])))
        if integrator == "rk4":
            k.append(self._rate(self._along(x, k[1])))
            k.append(self._rate(self._along(x, k[2])))
        else:
            k = k[-1:]
        for each in k:
            x = self._along(x, each)
        return x

    def _along(self, x: Shapes, k: Shapes) -> Shapes:
        """x + h k, of the states; what is a quaternion's turns with its rate."""
        after = x | {name: _sum(x[name], slope) for name, slope in k.items() if name in x}
        for rotation in self.model.spec.rotations if self.turning else ():
            rate = [k[name] for name in rotation.errors]
            if any(part.names for part in rate):
                turned = _bent(*(x[part] for part in rotation.parts), *rate)
                after |= dict.fromkeys(rotation.parts, turned)
        return after

    def shape(self, tree: Tree, known: dict[str, Shape]) -> Shape:
        """The shape of a formula; `known` are the shapes of names, to which those of definitions are added."""
        if isinstance(tree, Name):
            if tree.name not in known and tree.name in self.definitions:
                known[tree.name] = self.shape(self.definitions[tree.name], known)
            return known.get(tree.name, CONSTANT)
        if not isinstance(tree, Call):
            return CONSTANT
        parts = [self.shape(argument, known) for argument in tree.args]
        contained = frozenset().union(*(part.names for part in parts))
        if not contained or (tree.op == "rotation" and not self.turning and contained <= self._attitude):
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
        for variable, names in part.slopes.items():
            slopes[variable] = slopes.get(variable, _NONE) | names
    return Shape(frozenset().union(*(part.names for part in parts)), slopes, any(part.jumps for part in parts))


def _product(a: Shape, b: Shape) -> Shape:
    """d(ab) = da b + a db."""
    both = _sum(a, b)
    slopes = dict(both.slopes)
    for factor, other in ((a, b), (b, a)):
        for variable in factor.slopes:
            slopes[variable] = slopes[variable] | other.names
    return replace(both, slopes=slopes)


def _quotient(a: Shape, b: Shape) -> Shape:
    return _product(a, _bent(b))


def _bent(*parts: Shape) -> Shape:
    """A function whose derivatives contain all that it contains."""
    both = _sum(*parts)
    return replace(both, slopes=dict.fromkeys(both.slopes, both.names))


def _turning(*parts: Shape) -> Shape:
    """An angle of something: it jumps by a turn."""
    return replace(_bent(*parts), jumps=True)


def _selected(condition: Shape, a: Shape, b: Shape) -> Shape:
    """d where(c, a, b) = where(c, da, db)."""
    both, names = _sum(a, b), condition.names
    slopes = {variable: contained | names for variable, contained in both.slopes.items()}
    return Shape(both.names | names, slopes, both.jumps or bool(names))


def _flat(*parts: Shape) -> Shape:
    """Steps: their derivative is 0."""
    return Shape(_sum(*parts).names, {}, jumps=True)


def _table(x: Shape, *points: Shape) -> Shape:
    """Piecewise linear in x, and linear in the heights with coefficients that contain x."""
    heights = _sum(*points)
    slopes = {variable: names | x.names for variable, names in heights.slopes.items()}
    return _sum(replace(heights, slopes=slopes), _bent(replace(x, names=x.names | heights.names)))


_RULES: dict[str, Callable[..., Shape]] = {
    "add": _sum, "sub": _sum, "neg": _sum, "mul": _product, "div": _quotient, "where": _selected, "table": _table,
    "rotation_vector": _turning, "atan": _turning, "atan2": _turning, "sign": _flat, "floor": _flat, "lt": _flat,
    "le": _flat, "gt": _flat, "ge": _flat, "and": _flat, "or": _flat, "not": _flat,
}  # fmt: skip
