"""Where the covariance of a filter starts."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.errors import KfgenError
from kfgen.spec.tree import Expression
from kfgen.spec.types import Spec


def initial_covariance(spec: Spec, number: Callable[[Expression], Fraction]) -> tuple[tuple[Fraction, ...], ...]:
    """P0 of the n errors (n, n): as the spec has it whole, or variances and covariances. number: a formula's value."""
    if spec.P0 is not None:
        return tuple(tuple(number(e) for e in row) for row in spec.P0)
    index = {name: i for i, name in enumerate(spec.errors)}
    variances = {s.name: s.variance for s in spec.states}
    variances |= {name: v for r in spec.rotations for name, v in zip(r.errors, r.variances, strict=True)}
    n = len(index)
    P = [[Fraction(0)] * n for _ in range(n)]
    for name, i in index.items():
        variance = variances[name]
        if variance is None:
            raise KfgenError(f"state {name} has neither std nor var")
        P[i][i] = number(variance)
    for c in spec.covariances:
        i, j = index[c.first], index[c.second]
        P[i][j] = P[j][i] = number(c.value)
    return tuple(map(tuple, P))
