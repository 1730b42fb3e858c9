"""A predicted covariance gathered from the deviations of sigma points into numbers: Q + sum of w d d^T."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.factors import indefinite
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import downdate
from kfgen.filters.algebra.numbers import assume_nonnegative, assume_positive, is_positive, is_zero
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.base import P
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Weight
from kfgen.filters.frame import guards
from kfgen.ir.trace import Array, Trace, Value, Variable


class GatheredEntries:
    """For a full P: sums of products, one variable per entry; Q and a common weight come in at the end."""

    rewrites = False

    def __init__(self, t: Trace, Q: Additive, columns: list[tuple[Vector, Value]], how: Gathering) -> None:
        self.t = t
        names = how.names
        self.n = len(names)
        self.epsilon = how.epsilon
        self.checked = how.checked
        self.common = how.common
        self.outside: list[tuple[Vector, Weight]] = list(columns)
        self.Q = Q.entries()
        self.sums = {(i, j): t.variable(f"sum_{names[i]}_{names[j]}", 0) for j in range(self.n) for i in range(j + 1)}
        self.depth = t.depth

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        self.add(d, weight)

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        self.subtract(d, weight)

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


class GatheredFactors(Generic[P]):
    """For U D U^T and for a triangular root: rank-one updates of U and D, kept in variables."""

    rewrites = False

    def __init__(
        self, t: Trace, Q: Additive, columns: list[tuple[Vector, Value]], how: Gathering,
        finish: Callable[[Rows, Vector], P],
    ) -> None:  # fmt: skip
        """finish: what the form makes of U, D."""
        self.t = t
        self.finish = finish
        names = how.names
        n = self.n = len(names)
        self.epsilon = how.epsilon
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

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        self.add(d, weight)

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        self.subtract(d, weight)

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

    def result(self) -> tuple[P, list[Value]]:
        return self.finish(*self._read()), self.failures
