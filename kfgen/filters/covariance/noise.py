"""The additive process noise of a prediction: its entries, and its factors for layouts that absorb columns."""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.factors import udu, udu_computed
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import Number, is_zero, require_nonnegative
from kfgen.filters.algebra.symmetric import assembled

NEGATIVE = "a noise variance is negative"


class Additive(Protocol):
    """Q (n, n) in the filter's inner order."""

    def entries(self) -> Rows:
        """Q, tested to be positive semidefinite where that is not known."""
        ...

    def factors(self) -> tuple[Rows, Vector]:
        """U, D with U D U^T = Q, likewise."""
        ...


class Given:
    """A Q of formulas, which may turn out to be no covariance."""

    def __init__(self, Q: Rows) -> None:
        self.Q = Q

    def entries(self) -> Rows:
        if any(q.constant is None for row in self.Q for q in row):  # a constant Q was tested with the spec
            diagonal = [self.Q[i][i] for i in range(len(self.Q))]
            for q in diagonal if _is_diagonal(self.Q) else udu(self.Q)[1]:
                require_nonnegative(q, NEGATIVE)
        return self.Q

    def factors(self) -> tuple[Rows, Vector]:
        U, D = _trivial(self.Q) if _is_diagonal(self.Q) else udu(self.Q)
        for d in D:
            require_nonnegative(d, NEGATIVE)
        return U, D


class Computed:
    """A Q that is a covariance but for rounding: its pivots are not below `smallest` of its diagonal."""

    def __init__(self, Q: Rows, smallest: Fraction) -> None:
        self.Q = Q
        self.smallest = smallest

    def entries(self) -> Rows:
        return self.Q

    def factors(self) -> tuple[Rows, Vector]:
        return _trivial(self.Q) if _is_diagonal(self.Q) else udu_computed(self.Q, self.smallest)


class Factored:
    """A Q that is kept as its factors. field: where, U above D, upper triangle by columns; times: by what D is more."""

    def __init__(self, U: Rows, D: Vector, field: str = "", times: Number = 1) -> None:
        self.field = field
        self.times = times
        self.U = U
        self.D = D

    def entries(self) -> Rows:
        P = assembled(self.U, self.D)
        return [[P[i, j] for j in range(P.n)] for i in range(P.n)]

    def factors(self) -> tuple[Rows, Vector]:
        return [list(row) for row in self.U], list(self.D)


def _is_diagonal(Q: Rows) -> bool:
    n = len(Q)
    return all(is_zero(Q[i][j]) for i in range(n) for j in range(i + 1, n))


def _trivial(Q: Rows) -> tuple[Rows, Vector]:
    """The factors of a diagonal matrix; a fresh U, since it is built upon."""
    n = len(Q)
    return linalg.zeros(n, n), [Q[i][i] for i in range(n)]
