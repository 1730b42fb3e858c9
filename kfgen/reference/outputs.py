"""What firmware reads of an estimate: functions of the state, and their standard deviations to first order."""

from __future__ import annotations

import math

import numpy as np

from kfgen.reference.algorithm import Estimate
from kfgen.reference.dual import Vector, jacobian, values, variables
from kfgen.reference.model import Context, Model


class Outputs:
    """The outputs of a spec. Attribute: names."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.names = tuple(output.name for output in model.spec.outputs)
        self._formulas = [model.scope.compile(output.value) for output in model.spec.outputs]

    def values(self, estimate: Estimate, context: Context) -> dict[str, float]:
        """g(x) by name; all NaN where one is not finite."""
        return self._told(self._seen(estimate, context)[0])

    def deviations(self, estimate: Estimate, context: Context) -> dict[str, float]:
        """sqrt(diag(J P J^T)), J = dg/dx at x; all NaN where a value or a variance is not finite."""
        y, variance = self._seen(estimate, context)
        return self._told(np.sqrt(np.maximum(variance, 0.0)) if np.isfinite(y).all() else y)

    def _seen(self, estimate: Estimate, context: Context) -> tuple[Vector, Vector]:
        with np.errstate(all="ignore"):
            environment = self.model.environment(context, variables(estimate.x))
            found = [formula(environment) for formula in self._formulas]
            J = jacobian(found, self.model.n)
            return values(found), np.einsum("ki,ij,kj->k", J, estimate.P, J)

    def _told(self, numbers: Vector) -> dict[str, float]:
        if not np.isfinite(numbers).all():
            return dict.fromkeys(self.names, math.nan)
        return dict(zip(self.names, numbers.tolist(), strict=True))
