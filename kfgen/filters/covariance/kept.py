"""A covariance of noise that the filter keeps, as an adapted R or Q: dense, or as its factors."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from kfgen.filters.algebra.factors import udu
from kfgen.filters.algebra.linalg import Rows, Vector, plus, times
from kfgen.filters.algebra.numbers import assume_nonnegative, assume_positive
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric, assembled
from kfgen.filters.algebra.triangles import upper, upper_start
from kfgen.filters.base import Block
from kfgen.filters.covariance.names import entries
from kfgen.ir.trace import Trace, Value


class Kept:
    """A covariance in a field of the struct, dense or as its factors. initial: (k, k); names: of its k places."""

    def __init__(
        self, field: str, initial: list[list[Fraction]], factored: bool, doc: str, names: Sequence[str]
    ) -> None:
        self.field = field
        self.k = len(initial)
        self.initial = initial
        self.factored = factored
        self.names = names
        self.doc = doc + f"{', U above D' if factored else ''}: (i, j), i <= j, at j (j + 1) / 2 + i"

    def block(self) -> Block:
        matrix: Rows = self.initial
        if self.factored:
            U, D = udu([list(row) for row in self.initial])
            matrix = [[D[i] if i == j else U[i][j] for j in range(self.k)] for i in range(self.k)]
        flat = tuple(Fraction(matrix[i][j]) for j in range(self.k) for i in range(j + 1))
        return Block(self.field, len(flat), self.doc, initial=flat, entries=entries(self.field[0].lower(), self.names))

    def factors(self, t: Trace) -> tuple[Rows, Vector]:
        """U, D as they are kept. What is positive at first stays so: it is only ever multiplied and added to."""
        U = [[self._load(t, i, j) if i < j else t.zero for j in range(self.k)] for i in range(self.k)]
        _, D0 = udu([list(row) for row in self.initial])
        D = [self._load(t, j, j) for j in range(self.k)]
        for value, first in zip(D, D0, strict=True):
            assume_positive(value) if first > 0 else assume_nonnegative(value)
        return U, D

    def entries(self, t: Trace) -> Symmetric:
        """The dense matrix."""
        if self.factored:
            return assembled(*self.factors(t))
        return Symmetric(self.k, lambda i, j: self._load(t, i, j))

    def store(self, t: Trace, entries: Symmetric, factors: tuple[Rows, Vector] | None) -> None:
        """The new matrix."""
        for j in range(self.k):
            for i in range(j + 1):
                kept = entries[i, j] if factors is None else factors[1][j] if i == j else factors[0][i][j]
                t.store(f"kf.{self.field}", upper(i, j), t.value(kept))

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """An entry for counters i <= j."""

        def at(row: Value, col: Value) -> Value:
            place = upper_start(col) + row
            return t.element(f"kf.{self.field}", place)

        if not self.factored:
            return at(i, j)
        total = t.variable("sum", at(j, j))
        with t.when(i < j):
            total.set(total.get() * at(i, j))
        with t.loop("k", j + 1, self.k) as k:
            total.set(total.get() + at(i, k) * at(k, k) * at(j, k))
        return total.get()

    def _load(self, t: Trace, i: int, j: int) -> Value:
        return t.element(f"kf.{self.field}", upper(i, j))

    def learnt(self, t: Trace, steps: list[Vector], rate: Fraction) -> tuple[Symmetric, tuple[Rows, Vector] | None]:
        """(1 - rate) Q + rate sum of dx dx^T over some dx (n,): entries, and factors where they are kept."""
        if self.factored:
            U, D = self.factors(t)
            D = [d * (1 - rate) for d in D]
            rank_one(U, D, [([t.value(x) for x in dx], t.value(rate), -1) for dx in steps], safe=True)
            return assembled(U, D), (U, D)
        Q = self.entries(t)

        def entry(i: int, j: int) -> Value:
            total = Q[i, j] * (1 - rate)
            for dx in steps:
                total = plus(total, times(times(dx[i], rate), dx[j]))
            value: Value = total
            return value

        return Symmetric(self.k, entry), None
