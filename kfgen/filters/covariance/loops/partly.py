"""A covariance in numbers that is gathered from sigma points in loops over arrays: for many states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import assume_nonnegative
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.algebra.triangles import strict_size, upper_start
from kfgen.filters.covariance.base import P
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Weight
from kfgen.ir.trace import Array, Trace, Value


class EntriesInLoops:
    """A full P gathered from deviations that stand in an array."""

    rewrites = True

    def __init__(self, t: Trace, Q: Additive, columns: list[tuple[Vector, Value]], how: Gathering) -> None:
        assert how.common is not None
        self.t = t
        self.n = len(how.names)
        self.common = how.common
        self.Q = Q.entries()
        self.outside: list[tuple[Vector, Weight]] = list(columns)
        self.sum = t.array("sum", self.n * (self.n + 1) // 2)
        with t.loop("i", 0, self.n * (self.n + 1) // 2) as i:
            self.sum[i] = 0

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """+ d d^T of the deviations from `at` on; the common weight comes in at the end."""
        with self.t.loop("j", 0, self.n) as j, self.t.loop("i", 0, j + 1) as i:
            place = upper_start(j) + i
            self.sum[place] = self.sum[place] + array[at + i] * array[at + j]

    def add(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, weight))

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        raise AssertionError("not for negative weights: see Gathering")

    def subtract(self, d: Vector, weight: Weight) -> None:
        raise AssertionError("not for negative weights: see Gathering")

    def result(self) -> tuple[Symmetric, list[Value]]:
        t = self.t

        def entry(i: int, j: int) -> Value:
            total: Value = t.value(linalg.plus(self.sum[j * (j + 1) // 2 + i] * self.common, self.Q[i][j]))
            for d, weight in self.outside:
                total = t.value(linalg.plus(total, linalg.times(linalg.times(d[i], weight), d[j])))
            return total

        return Symmetric(self.n, entry), []


class FactorsInLoops(Generic[P]):
    """U D U^T gathered likewise, by a private function that absorbs one column."""

    rewrites = True

    def __init__(
        self, t: Trace, order: list[int], Q: Additive, columns: list[tuple[Vector, Value]], how: Gathering,
        finish: Callable[[Rows, Vector], P],
    ) -> None:  # fmt: skip
        """order: inner position -> state. finish: what the form makes of U, D."""
        assert how.common is not None
        assert how.absorb is not None
        self.t = t
        self.order = order
        self.finish = finish
        n = self.n = len(order)
        self.common = how.common
        self.absorb = how.absorb
        U, D = Q.factors()
        for w, d in columns:
            rank_one(U, D, [(w, assume_nonnegative(d), -1)], safe=True)
        self.U, self.D = t.array("factor", strict_size(n)), t.array("diagonal", n)
        self.w = t.array("w", n)
        for j in range(n):
            for i in range(j):
                self.U[j * (j - 1) // 2 + i] = t.value(U[i][j])
            self.D[j] = t.value(D[j])

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """+ w d d^T of the deviations from `at` on, w the common weight."""
        straight = self.order == list(range(self.n))
        with self.t.loop("i", 0, self.n) as i:
            self.w[i] = array[at + i] if straight else array[at + ((self.n - 1) - i)]
        self._call(self.t.value(self.common))

    def add(self, d: Vector, weight: Weight) -> None:
        for i, x in enumerate(d):
            self.w[i] = self.t.value(x)
        self._call(self.t.value(weight))

    def _call(self, weight: Value) -> None:
        self.t.call(self.absorb, [(self.U.name, 0), (self.D.name, 0), (self.w.name, 0), weight])

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        raise AssertionError("not for negative weights: see Gathering")

    def subtract(self, d: Vector, weight: Weight) -> None:
        raise AssertionError("not for negative weights: see Gathering")

    def result(self) -> tuple[P, list[Value]]:
        n, t = self.n, self.t
        U: Rows = [[self.U[j * (j - 1) // 2 + i] if i < j else t.zero for j in range(n)] for i in range(n)]
        D = [assume_nonnegative(self.D[j]) for j in range(n)]
        return self.finish(U, D), []
