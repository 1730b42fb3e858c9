"""What a covariance layout offers to the filters. A new layout is a class with these methods, in a file of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, is_zero, select
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import Block
from kfgen.filters.covariance.noise import Additive
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value

Covariance = Any  # the layout's own: factors, entries, ...


@dataclass(frozen=True)
class GainChange:
    """What `consider` and `gain_limit` make of a gain. considered: inner positions."""

    considered: frozenset[int]
    limit: Fraction | None

    def __call__(self, K: Vector) -> Vector:
        K = [0 if i in self.considered else k for i, k in enumerate(K)]
        limit = self.limit
        if limit is None:
            return K
        return [k if is_zero(k) else select(k > limit, limit, select(k < -limit, -limit, k)) for k in K]


class Layout(Protocol):
    """A covariance of n states in the filter's inner order, and how it is predicted, updated and stored."""

    n: int
    title: str  # "U D U^T"
    order: list[int]  # inner position -> state of the spec
    reorders: bool  # whether that order is the generator's choice, for the header to tell
    rolled: bool  # whether it is emitted as loops over arrays
    change: GainChange | None  # joseph only: the other forms need the gain that they make
    factored: bool  # whether an adapted Q or R is kept as its factors
    group: int  # scalar measurements that are best updated together

    @property
    def tables(self) -> Mapping[str, tuple[int, ...]]:
        """Of indices, that its loops look up; known when the functions have been traced."""
        ...

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        """The fields of the struct that hold it, with the values of P0 (n, n)."""
        ...

    def load(self, t: Trace) -> Covariance:
        """The covariance as it stands in the struct."""
        ...

    def predict(self, t: Trace, P: Covariance, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Covariance:
        """F P F^T + Q + sum of d w w^T over the noise columns (w, d). F: (n, n)."""
        ...

    def update(self, t: Trace, P: Covariance, measurements: list[Measurement]) -> tuple[Covariance, Rows, Vector]:
        """Scalar measurements one after another: P, the gains (m, n), the innovation variances (m,).

        The P that is given stays as it is.
        """
        ...

    def entries(self, P: Covariance) -> Symmetric:
        """P as a dense matrix; what is not asked for is not computed."""
        ...

    def variance(self, P: Covariance, h: Vector) -> Number:
        """h P h^T."""
        ...

    def inflated(self, P: Covariance, a: Number) -> Covariance:
        """a P."""
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

    def root(self, P: Covariance, tolerance: Fraction) -> tuple[list[Vector], list[Value]]:
        """The columns of a root of P, each (n,), and conditions under which P is indefinite.

        A pivot up to `tolerance` of its diagonal is a direction without spread.
        """
        ...

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> Covariance:
        """U D U^T (layouts that are factored)."""
        ...

    def factors(self, P: Covariance) -> tuple[Rows, Vector]:
        """U, D with U D U^T = P (layouts that are factored); fresh lists, since they are built upon."""
        ...

    def columns(self, P: Covariance) -> list[tuple[Vector, Number]]:
        """P as a sum of d w w^T over columns (w, d)."""
        ...

    def downdated(
        self, t: Trace, P: Covariance, c: Vector, s: Number, tolerance: Fraction, sure: bool, prior: Covariance
    ) -> tuple[Covariance, Value]:
        """P - c c^T / s, s > 0, and the condition under which that is indefinite beyond `tolerance`, relative.

        sure: it cannot be, but for rounding that leaves variances positive. prior: P before all of an update, to
        which round-off is relative.
        """
        ...

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        """Further functions of the filter that this layout offers. outdated: as in CovarianceCode."""
        ...

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij of the struct for loop counters i <= j."""
        ...

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store a covariance given as the upper triangle of P and of its factors (D on the diagonal, U above)."""
        ...


class Rolled(Layout, Protocol):
    """A layout that is emitted as loops."""

    def placed(self, P: Covariance) -> dict[str, Array]:
        """Local arrays that hold P as the fields of the struct do, by the paths of these."""
        ...

    def learn(self, moved: Any, field: str, rate: Fraction, sure: bool) -> None:
        """Q <- (1 - rate) Q + rate times the sum of dx dx^T, in a field of the struct. sure: Q is known to be definite.

        moved: the Displacement of which dx are the terms. Nothing can fail any more, and the arrays of P are free.
        """
        ...
