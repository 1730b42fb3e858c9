"""The first measurements of some sensors, which set states and variances in place of an update."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kfgen.reference.algorithm import Estimate, Estimator
from kfgen.reference.dual import Matrix, Vector, value_of
from kfgen.reference.evaluate import Closure, renamed
from kfgen.reference.model import Model, measured
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError
from kfgen.spec.tree import Call, Expression, Name, Tree, names
from kfgen.spec.types import Initialize


class Rule:
    """What the first measurement of one sensor sets.

    Attributes: sensor; waits: whether all else waits for it; components: names of those that it is made of; read: the
    other names in its formulas.
    """

    def __init__(self, model: Model, rule: Initialize) -> None:
        self.model = model
        self.sensor = rule.sensor
        self.waits = rule.waits
        (sensor,) = [each for each in model.spec.measurements if each.name == rule.sensor]
        hidden = {component.name: measured(rule.sensor, component.name) for component in sensor.components}
        self._hidden = hidden
        formulas = [*rule.states.values(), *rule.variance.values(), *(d.value for d in rule.let)]
        shared = {definition.name: definition.value.tree for definition in rule.let}
        used = {name for formula in formulas for name in names(formula.tree)} - set(shared)
        self.components = tuple(name for name in hidden if name in used)
        self.read = frozenset(used - set(hidden))

        def compiled(formula: Expression) -> Closure:
            return model.scope.compile(renamed(inlined(formula.tree), hidden))

        def inlined(tree: Tree) -> Tree:
            if isinstance(tree, Name) and tree.name in shared:
                return inlined(shared[tree.name])
            return replace(tree, args=tuple(map(inlined, tree.args))) if isinstance(tree, Call) else tree

        self._states = {name: compiled(formula) for name, formula in rule.states.items()}
        self._variances = {name: compiled(formula) for name, formula in rule.variance.items()}

    def complete(self, reading: Reading) -> bool:
        """Whether all components that it is made of are there."""
        names = reading.sensor.components
        return all(names.index(component) in reading.used for component in self.components)

    def apply(self, algorithm: Estimator, estimate: Estimate, reading: Reading) -> Estimate:
        """The estimate that it leaves. Raises StepError NOT_FINITE, or NOT_POSITIVE of a variance below 0."""
        model = self.model
        environment = model.environment(reading.context, model.x0, own=reading.sensor.own)
        for component, value in zip(reading.sensor.components, reading.z.tolist(), strict=True):
            environment[model.scope.slots[self._hidden[component]]] = value
        with np.errstate(all="ignore"):
            states = {model.index[name]: value_of(f(environment)) for name, f in self._states.items()}
            variances = {model.index[name]: value_of(f(environment)) for name, f in self._variances.items()}
        if not all(map(math.isfinite, (*states.values(), *variances.values()))):
            raise StepError(Status.NOT_FINITE)
        if any(variance < 0.0 for variance in variances.values()):
            raise StepError(Status.NOT_POSITIVE)

        def moved(x: Vector) -> Vector:
            x = x.copy()
            x[list(states)] = list(states.values())
            return model.wrap(model.clip(x))

        def spread(P: Matrix) -> Matrix:
            P = P.copy()
            for i, variance in variances.items():
                P[i, :] = P[:, i] = 0.0
                P[i, i] = variance
            return P

        estimate = algorithm.placed(estimate, moved)
        return algorithm.respread(estimate, spread) if variances else estimate
