"""A predicted covariance gathered from the deviations of sigma points, in loops: Q + sum of w d d^T."""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.factors import cholesky, indefinite, root_of_factors, udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import downdate
from kfgen.filters.algebra.numbers import (
    assume_nonnegative,
    assume_positive,
    is_constant,
    is_positive,
    is_zero,
    require_nonnegative,
    select,
)  # fmt: skip
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.base import Covariance, Layout
from kfgen.filters.covariance.noise import NEGATIVE, Additive
from kfgen.filters.frame import guards
from kfgen.ir.trace import Trace, Value, Variable

Weight = Value | Fraction


class Gatherer(Protocol):
    """Starts at Q and takes deviations in the inner order, inside of loops or not."""

    def add(self, d: Vector, weight: Weight) -> None:
        """+ w d d^T, w >= 0."""
        ...

    def subtract(self, d: Vector, weight: Weight) -> None:
        """- w d d^T, w > 0; it fails where the result is not positive semidefinite."""
        ...

    def result(self) -> tuple[Covariance, list[Value]]:
        """The covariance, and conditions of failure."""
        ...


def gatherer(t: Trace, layout: Layout, Q: Additive, columns: list[tuple[Vector, Value]], names: list[str],
             common: Fraction | None, epsilon: Fraction, checked: bool) -> Gatherer:  # fmt: skip
    """One for the layout. columns: (w, d) of noise that is not additive.

    common: the weight of all that is added in loops, if it is the same. checked: a full covariance may come out
    indefinite by negative weights, and is tested.
    """
    if layout.factored:
        return _Factors(t, layout, Q, columns, names, epsilon)
    return _Entries(t, layout, Q, columns, names, common, epsilon, checked)


class _Entries:
    """For a full P: sums of products, one variable per entry; Q and a common weight come in at the end."""

    def __init__(self, t: Trace, layout: Layout, Q: Additive, columns: list[tuple[Vector, Value]], names: list[str],
                 common: Fraction | None, epsilon: Fraction, checked: bool) -> None:  # fmt: skip
        self.t = t
        self.n = layout.n
        self.epsilon = epsilon
        self.checked = checked
        self.common = common
        self.outside: list[tuple[Vector, Weight]] = list(columns)
        self.Q = Q.entries()
        self.sums = {
            (i, j): t.variable(f"sum_{names[i]}_{names[j]}", 0) for j in range(self.n) for i in range(j + 1)
        }
        self.depth = t.depth

    def add(self, d: Vector, weight: Weight) -> None:
        if self.t.depth == self.depth:
            self.outside.append((d, weight))
            return
        scaled = d if weight == self.common else [linalg.times(x, weight) for x in d]
        for (i, j), variable in self.sums.items():
            if not is_zero(d[i]) and not is_zero(d[j]):
                variable.set(variable.get() + d[i] * scaled[j])

    def subtract(self, d: Vector, weight: Weight) -> None:
        self.add(d, -weight)

    def result(self) -> tuple[Symmetric, list[Value]]:
        t = self.t

        def entry(i: int, j: int) -> Value:
            total = self.sums[i, j].get()
            total = t.value(linalg.plus(total if self.common is None else total * self.common, self.Q[i][j]))
            for d, weight in self.outside:
                total = t.value(linalg.plus(total, linalg.times(linalg.times(d[i], weight), d[j])))
            return total

        P = Symmetric(self.n, entry)
        for i in range(self.n):
            for j in range(i, self.n):
                _ = P[i, j]
        return P, indefinite(P, self.n * self.epsilon) if self.checked else []


class _Factors:
    """For U D U^T and for a triangular root: rank-one updates of U and D, kept in variables."""

    def __init__(self, t: Trace, layout: Layout, Q: Additive, columns: list[tuple[Vector, Value]], names: list[str],
                 epsilon: Fraction) -> None:  # fmt: skip
        self.t = t
        self.layout = layout
        n = self.n = layout.n
        self.epsilon = epsilon
        U, D = Q.factors()
        for column, d in columns:
            assume_nonnegative(d)
            rank_one(U, D, [(column, d, -1)], safe=True)
        self.sure = [is_positive(t.value(d)) for d in D]
        self.U: dict[tuple[int, int], Variable] = {
            (i, j): t.variable(f"u_{names[i]}_{names[j]}", t.value(U[i][j])) for j in range(n) for i in range(j)
        }
        self.D = [t.variable(f"d_{name}", t.value(d)) for name, d in zip(names, D, strict=True)]
        self.failures: list[Value] = []
        self.depth = t.depth

    def _read(self) -> tuple[Rows, Vector]:
        n = self.n
        U: Rows = [[self.U[i, j].get() if i < j else self.t.zero for j in range(n)] for i in range(n)]
        D = [variable.get() for variable in self.D]
        for d, sure in zip(D, self.sure, strict=True):
            assume_positive(d) if sure else assume_nonnegative(d)
        return U, D

    def _write(self, U: Rows, D: Vector) -> None:
        for (i, j), variable in self.U.items():
            variable.set(U[i][j])
        for variable, d in zip(self.D, D, strict=True):
            variable.set(d)

    def add(self, d: Vector, weight: Weight) -> None:
        U, D = self._read()
        rank_one(U, D, [(d, self.t.value(weight), -1)], safe=True)
        self._write(U, D)

    def subtract(self, d: Vector, weight: Weight) -> None:
        U, D = self._read()
        failed, gone = downdate(U, D, d, 1 / self.t.value(weight), 8 * self.n * self.epsilon)
        self.t.flag(gone, "REGULARIZED")
        if self.t.depth == self.depth:
            self.failures.append(failed)
        else:  # in a loop: nothing has been stored yet
            guards.finite(self.t, d)
            self.t.guard(failed, "NOT_POSITIVE")
        self.sure = [False] * self.n
        self._write(U, D)

    def result(self) -> tuple[Covariance, list[Value]]:
        U, D = self._read()
        return self.layout.from_factors(self.t, U, D), self.failures


def noise_root(C: Rows, form: str, tolerance: Fraction) -> tuple[Rows, list[Value]]:
    """A root of the covariance of noise inputs (q, q), of the kind that the form of the covariance has; and what of C
    has to be tested to be finite. That C is a covariance is left to a guard."""
    values = [v for row in C for v in row if v.constant is None]
    if not C:
        return [], values
    U, D = udu(C)
    for d in D:
        require_nonnegative(d, NEGATIVE)
    if form == "ud":
        D = [d if is_constant(d) else select(d > 0, d, 0) for d in D]
        return root_of_factors(U, D), values
    S, _ = cholesky(lambda i, j: C[i][j], len(C), tolerance)
    return S, values
