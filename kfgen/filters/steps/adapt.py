"""Noise covariances that are learnt from the innovations: R per sensor, Q (Mehra 1970; Akhlaghi et al. 2017).

They are part of the filter's state: kept full, or as factors (U above D) where the layout is factored.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import assume_nonnegative, assume_positive, is_zero, select
from kfgen.filters.algebra.symmetric import Symmetric, assembled
from kfgen.filters.base import Block
from kfgen.filters.covariance.names import entries
from kfgen.filters.covariance.noise import Additive, Computed, Factored
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel


def packed(i: int, j: int) -> int:
    """Position of an entry, i <= j, of an upper triangle column by column."""
    return j * (j + 1) // 2 + i


def _constants(matrix: tuple[tuple[object, ...], ...]) -> list[list[Fraction]]:
    lowering = Lowering(Trace(), {})
    values = [[lowering(e).constant for e in row] for row in matrix]
    return [[Fraction(0) if v is None else v for v in row] for row in values]


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
            U, D = linalg.udu([list(row) for row in self.initial])
            matrix = [[D[i] if i == j else U[i][j] for j in range(self.k)] for i in range(self.k)]
        flat = tuple(Fraction(matrix[i][j]) for j in range(self.k) for i in range(j + 1))
        return Block(self.field, len(flat), self.doc, initial=flat, entries=entries(self.field[0].lower(), self.names))

    def factors(self, t: Trace) -> tuple[Rows, Vector]:
        """U, D as they are kept. What is positive at first stays so: it is only ever multiplied and added to."""
        U = [[self._load(t, i, j) if i < j else t.zero for j in range(self.k)] for i in range(self.k)]
        _, D0 = linalg.udu([list(row) for row in self.initial])
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
                t.store(f"kf.{self.field}", packed(i, j), t.value(kept))

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """An entry for counters i <= j."""
        def at(row: Value, col: Value) -> Value:
            place = t.wrapped(t.pool.make("half", ((col * (col + 1)).node,), kind="int")) + row
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
        return t.element(f"kf.{self.field}", packed(i, j))


class AdaptedR:
    """R of a sensor: R <- (1 - a) R + a (H P^- H^T + e e^T), e the residual after the sensor's update before."""

    def __init__(self, model: Model, sensor: SensorModel, factored: bool, epsilon: Fraction) -> None:
        assert model.options.adapt_R is not None
        self.rate = model.options.adapt_R
        self.m = len(sensor.h)
        self.residual_field = f"residual_{sensor.name}"
        names = [c.name for c in sensor.spec.components]
        self.kept = Kept(f"R_{sensor.name}", _constants(sensor.R), factored, f"R of {sensor.name}, adapted", names)
        self.smallest = self.m * epsilon
        self.next: Symmetric | None = None

    def blocks(self) -> list[Block]:
        doc = "z - h(x) after the last update"
        zeros = (Fraction(0),) * self.m
        return [self.kept.block(), Block(self.residual_field, self.m, doc, initial=zeros)]

    def residuals(self, t: Trace) -> list[Value]:
        return [t.element(f"kf.{self.residual_field}", i) for i in range(self.m)]

    def adapted(self, t: Trace, spread: Symmetric, used: list[Value] | None) -> Symmetric:
        """The R of this update. spread: H P^- H^T (m, m).

        Components that are not used keep their block; between them and the others (1 - a) R stays, so that the
        whole remains positive.
        """
        R, e, a = self.kept.entries(t), self.residuals(t), self.rate

        def entry(i: int, j: int) -> Value:
            rest = R[i, j] * (1 - a)
            new: Value = rest + (spread[i, j] + e[i] * e[j]) * a
            if i == j:  # a square and variances, whatever they are sums of
                assume_positive(new) if self.kept.initial[i][i] > 0 else assume_nonnegative(new)
            if used is None:
                return new
            neither = select(used[i] | used[j], rest, R[i, j])
            value: Value = select(used[i] & used[j], new, neither)
            return t.name(value, "r_adapted")

        self.next = Symmetric(self.m, entry)
        return self.next

    def store(self, t: Trace, after: Vector, used: list[Value] | None) -> None:
        """R and the residual after the update."""
        assert self.next is not None
        factors = None
        if self.kept.factored:
            dense = [[self.next[i, j] for j in range(self.m)] for i in range(self.m)]
            factors = linalg.udu_computed(dense, self.smallest)
        self.kept.store(t, self.next, factors)
        for i, e in enumerate(after):
            t.store(f"kf.{self.residual_field}", i, e if used is None else select(used[i], e, self.residuals(t)[i]))


class AdaptedQ:
    """The additive Q: Q <- (1 - b) Q + b sum of dx dx^T over the corrections of an update."""

    def __init__(self, model: Model, order: list[int], factored: bool, epsilon: Fraction) -> None:
        assert model.options.adapt_Q is not None
        self.rate = model.options.adapt_Q
        Q = _constants(model.Q)
        doc, names = "additive process noise, adapted", [model.states[i] for i in order]
        self.kept = Kept("Q", [[Q[i][j] for j in order] for i in order], factored, doc, names)
        self.smallest = len(order) * epsilon

    def additive(self, t: Trace, added: Rows | None) -> Additive:
        """The Q of a prediction. added: what noise densities add to it (n, n)."""
        n = self.kept.k
        nothing = added is None or all(is_zero(q) for row in added for q in row)
        if nothing and self.kept.factored:
            return Factored(*self.kept.factors(t), f"kf.{self.kept.field}")
        entries = self.kept.entries(t)
        total = [[entries[i, j] for j in range(n)] for i in range(n)]
        if added is not None:
            total = [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(total, added, strict=True)]
        return Computed(total, self.smallest)

    def next(self, t: Trace, steps: list[Vector]) -> tuple[Symmetric, tuple[Rows, Vector] | None]:
        """Entries, and factors where they are kept, after corrections dx (n,)."""
        b, n = self.rate, self.kept.k
        if self.kept.factored:
            U, D = self.kept.factors(t)
            D = [d * (1 - b) for d in D]
            linalg.rank_one(U, D, [([t.value(x) for x in dx], t.value(b), -1) for dx in steps], safe=True)
            return assembled(U, D), (U, D)
        Q = self.kept.entries(t)

        def entry(i: int, j: int) -> Value:
            total = Q[i, j] * (1 - b)
            for dx in steps:
                total = linalg.plus(total, linalg.times(linalg.times(dx[i], b), dx[j]))
            value: Value = total
            return value

        return Symmetric(n, entry), None
