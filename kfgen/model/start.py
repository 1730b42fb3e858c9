"""Where the covariance of a filter starts."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.errors import KfgenError
from kfgen.spec.tree import Expression
from kfgen.spec.types import Spec


def initial_covariance(spec: Spec, number: Callable[[Expression], Fraction]) -> tuple[tuple[Fraction, ...], ...]:
    """P0 (n, n): as the spec has it whole, or variances and covariances. number: the value of a formula."""
    if spec.P0 is not None:
        return tuple(tuple(number(e) for e in row) for row in spec.P0)
    index = {s.name: i for i, s in enumerate(spec.states)}
    n = len(index)
    P = [[Fraction(0)] * n for _ in range(n)]
    for i, state in enumerate(spec.states):
        if state.variance is None:
            raise KfgenError(f"state {state.name} has neither std nor var")
        P[i][i] = number(state.variance)
    for c in spec.covariances:
        i, j = index[c.first], index[c.second]
        P[i][j] = P[j][i] = number(c.value)
    return tuple(map(tuple, P))
