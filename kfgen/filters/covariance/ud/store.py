"""P = U D U^T in the struct: U strictly upper triangular by columns, D; U is unit upper triangular."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from kfgen.filters.algebra.factors import udu
from kfgen.filters.algebra.numbers import assume_nonnegative, sqrt
from kfgen.filters.algebra.triangles import strict_size, strict_start, upper_start
from kfgen.filters.base import Block
from kfgen.filters.covariance.definite import Definite
from kfgen.filters.covariance.kernels.function import Kernels, integer
from kfgen.filters.covariance.kernels.isolate import isolate
from kfgen.filters.covariance.names import entries, entry
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value


class UDStore(Definite):
    """The fields `U` and `D`. order: inner position -> state of the spec."""

    title = "U D U^T"
    reorders = True
    factored = True

    def __init__(self, order: list[int]) -> None:
        self.order = order
        self.n = len(order)

    def blocks(self, P0: list[list[Fraction]], names: Sequence[str]) -> list[Block]:
        n = self.n
        U, D = udu([list(row) for row in P0])
        flat = tuple(Fraction(U[i][j]) for j in range(n) for i in range(j))
        out = []
        if n > 1:
            doc = "unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i"
            called = entries("u", names, diagonal=False)
            out.append(Block("U", strict_size(n), doc, initial=flat, entries=called))
        out.append(Block("D", n, "diagonal factor: P = U D U^T", initial=tuple(Fraction(d) for d in D),
                         entries=tuple(entry("d", names, i) for i in range(n))))  # fmt: skip
        return out

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        return []

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j, summed in a loop."""
        n = self.n
        if n == 1:
            return t.element("kf.D", j)
        total = t.variable("sum", t.element("kf.D", j))
        with t.when(i < j):
            total.set(total.get() * t.element("kf.U", strict_start(j) + i))
        with t.loop("k", j + 1, n) as k:
            u = t.element("kf.U", strict_start(k) + i) * t.element("kf.D", k)
            total.set(total.get() + u * t.element("kf.U", strict_start(k) + j))
        return total.get()

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store the factors (D on the diagonal, U above, upper triangle column by column) of a covariance."""
        with t.loop("j", 0, self.n) as j:
            if self.n > 1:
                with t.loop("i", 0, j) as i:
                    t.store("kf.U", strict_start(j) + i, factors[upper_start(j) + i])
            t.store("kf.D", j, factors[upper_start(j) + j])

    def isolate(self, t: Trace, place: int, variance: Value) -> None:
        if self.n == 1:
            t.store("kf.D", 0, variance)
            return
        kernel = isolate(Kernels(Fraction(t.smallest), frozenset()), self.n)
        t.call(kernel, [("kf.U", 0), ("kf.D", 0), integer(t, place), variance])

    def root_array(self, t: Trace, own: Mapping[str, Array] | None = None) -> Array:
        """The columns of U sqrt(D), one after another. own: arrays in place of the fields."""
        n = self.n

        def of(path: str, index: Value) -> Value:
            return t.element(path, index) if own is None else own[path][index]

        out = t.array(t.unique("root"), n * n)
        with t.loop("j", 0, n) as j:
            scale = t.name(sqrt(assume_nonnegative(of("kf.D", j))), "scale")
            with t.loop("i", 0, j) as i:
                out[j * n + i] = of("kf.U", strict_start(j) + i) * scale
            out[j * n + j] = scale
            with t.loop("i", j + 1, n) as i:
                out[j * n + i] = 0
        return out
