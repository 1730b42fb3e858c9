"""P in the struct: its upper triangle, column by column."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.triangles import upper_size, upper_start
from kfgen.filters.base import Block
from kfgen.filters.covariance.kernels.correlations import limit, settle
from kfgen.filters.covariance.kernels.function import Kernels, integer
from kfgen.filters.covariance.names import entries
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value


class FullStore:
    """The field `P`. The states are in the spec's order."""

    title = "full"
    reorders = False
    factored = False

    def __init__(self, n: int, kernels: Kernels | None = None) -> None:
        self.n = n
        self.order = list(range(n))
        self.shared = kernels

    def limit_correlations(self, t: Trace) -> None:
        """Of the P that has been stored."""
        t.call(limit(self._kernels(t), self.n), [("kf.P", 0)])

    def loosen(self, t: Trace) -> None:
        """Forget the correlations of the P in the struct."""
        t.call(settle(self._kernels(t), self.n), [("kf.P", 0), integer(t, 1)])

    def settle(self, t: Trace) -> None:
        """Variances below zero of the P that has been stored: as large as rounding has left them."""
        t.call(settle(self._kernels(t), self.n), [("kf.P", 0), integer(t, 0)])

    def _kernels(self, t: Trace) -> Kernels:
        if self.shared is None:
            self.shared = Kernels(Fraction(t.smallest), frozenset())
        return self.shared

    def blocks(self, P0: list[list[Fraction]], names: Sequence[str]) -> list[Block]:
        flat = tuple(P0[i][j] for j in range(self.n) for i in range(j + 1))
        doc = "covariance: P_ij, i <= j, at j (j + 1) / 2 + i"
        return [Block("P", len(flat), doc, initial=flat, entries=entries("p", names))]

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        return []

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j."""
        return t.element("kf.P", upper_start(j) + i)

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store a covariance (upper triangle column by column) whose factors are known to be positive."""
        with t.loop("k", 0, upper_size(self.n)) as k:
            t.store("kf.P", k, P[k])

    def root_array(self, t: Trace, tolerance: Fraction, own: Array | None = None) -> Array:
        """The columns of the lower root of P, one after another. own: an array in place of the field.

        A pivot up to `tolerance` of its diagonal, or below 0, is a direction without spread.
        """
        n = self.n

        def entry(place: Value) -> Value:
            return t.element("kf.P", place) if own is None else own[place]

        out = t.array(t.unique("root"), n * n)
        with t.loop("j", 0, n) as j:
            diagonal = t.name(entry(upper_start(j) + j), "diagonal")
            pivot = t.variable("pivot", diagonal)
            with t.loop("k", 0, j) as k:
                pivot.set(pivot.get() - out[k * n + j] * out[k * n + j])
            left = t.name(pivot.get(), "left")
            least = t.name(diagonal * tolerance, "least")
            t.guard(~(diagonal >= 0), "NOT_POSITIVE")
            length = t.name(sqrt(select(left > least, left, 0)), "length")
            inverse = t.name(select(left > least, 1 / length, 0), "inverse")
            out[j * n + j] = length
            with t.loop("i", j + 1, n) as i:
                rest = t.variable("rest", entry(upper_start(i) + j))
                with t.loop("k", 0, j) as k:
                    rest.set(rest.get() - out[k * n + i] * out[k * n + j])
                out[j * n + i] = rest.get() * inverse
            with t.loop("i", 0, j) as i:
                out[j * n + i] = 0
        return out
