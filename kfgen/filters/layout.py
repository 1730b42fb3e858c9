"""What a covariance layout offers to the filters. A new layout is a class with these methods, in a file of its own."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, Protocol

from kfgen.filters.base import Block
from kfgen.filters.linalg import Rows, Vector
from kfgen.ir.trace import Array, Trace, Value

Covariance = Any  # the layout's own: factors, entries, ...


class Layout(Protocol):
    """A covariance of n states in the filter's inner order, and how it is predicted, updated and stored."""

    n: int
    title: str  # "U D U^T"
    reorders: bool  # whether the inner order of the states is the generator's to choose
    group: int  # scalar measurements that are best updated together

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        """The fields of the struct that hold it, with the values of P0 (n, n)."""
        ...

    def load(self, t: Trace) -> Covariance:
        """The covariance as it stands in the struct."""
        ...

    def predict(self, t: Trace, P: Covariance, F: Rows, Q: Rows, noise: list[tuple[Vector, Value]]) -> Covariance:
        """F P F^T + Q + sum of d w w^T over the noise columns (w, d). F, Q: (n, n)."""
        ...

    def update(self, t: Trace, P: Covariance, rows: Rows, variances: Vector) -> tuple[Covariance, Rows, Vector]:
        """Scalar measurements one after another: P, the gains (m, n), the innovation variances (m,)."""
        ...

    def tolerance(self, P: Covariance, h: Vector) -> Value | int:
        """How far below zero h P h^T may come out by round-off."""
        ...

    def limit(
        self, t: Trace, P: Covariance, floors: list[Fraction | None], ceilings: list[Fraction | None]
    ) -> Covariance:
        """variance_floor and variance_ceiling, flagged REGULARIZED."""
        ...

    def evidence(self, P: Covariance, after_predict: bool) -> list[Value]:
        """Values that, together with x and nis, are finite only if all of P is."""
        ...

    def store(self, t: Trace, P: Covariance, names: list[str], after_predict: bool) -> None:
        """Into the struct. names: of the states, for the locals."""
        ...

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij of the struct for loop counters i <= j."""
        ...

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store a covariance given as the upper triangle of P and of its factors (D on the diagonal, U above)."""
        ...
