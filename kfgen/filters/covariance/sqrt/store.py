"""P = S S^T in the struct: S the lower Cholesky factor, row by row (Kaminski, Bryson & Schmidt 1971).

Inside, the states are in reverse order: S is then upper triangular, and the kernels of U D U^T serve it too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from kfgen.filters.algebra.factors import udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import assume_nonnegative, constant_root, reciprocal, select, sqrt
from kfgen.filters.algebra.triangles import upper, upper_start
from kfgen.filters.base import CONST_KF, KF, Block
from kfgen.filters.covariance.definite import Definite
from kfgen.filters.covariance.kernels.function import Kernels, integer
from kfgen.filters.covariance.kernels.isolate import isolate_root
from kfgen.filters.covariance.names import entry
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value


class SqrtStore(Definite):
    """The field `S`."""

    title = "lower triangular square root"
    reorders = False
    factored = True

    def __init__(self, n: int) -> None:
        self.n = n
        self.order = list(reversed(range(n)))

    def packed(self, i: int, j: int) -> int:
        """Position of S_ij, i <= j: lower triangle row by row in the order of the spec."""
        row, place = self.n - 1 - i, self.n - 1 - j
        return row * (row + 1) // 2 + place

    def place(self, i: Value, j: Value) -> Value:
        """Position of S_ij for counters i <= j."""
        return upper_start((self.n - 1) - i) + ((self.n - 1) - j)

    def spot(self, t: Trace, i: int | Value, j: int | Value) -> int | Value:
        """Where S_ij stands in kf.S, i <= j."""
        if isinstance(i, int) and isinstance(j, int):
            return self.packed(i, j)
        return self.place(integer(t, i) if isinstance(i, int) else i, integer(t, j) if isinstance(j, int) else j)

    def blocks(self, P0: list[list[Fraction]], names: Sequence[str]) -> list[Block]:
        n = self.n
        U, D = udu([list(row) for row in P0])
        roots = [Fraction(0) if d == 0 else constant_root(d) for d in D]
        values = [Fraction(0)] * (n * (n + 1) // 2)
        for j in range(n):
            for i in range(j + 1):
                values[self.packed(i, j)] = roots[j] * (1 if i == j else Fraction(U[i][j]))
        doc = "lower triangular root, P = S S^T: S_ij, i >= j, at i (i + 1) / 2 + j"
        called = tuple(entry("s", names, n - 1 - i, n - 1 - j) for i in range(n) for j in range(i + 1))
        return [Block("S", len(values), doc, initial=tuple(values), entries=called)]

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        """The root in and out."""
        return [self._set_root(taken, outdated), self._get_root(taken)]

    def _set_root(self, taken: frozenset[str], outdated: str) -> Function:
        t, n = Trace(), self.n
        with t.loop("i", 0, n) as i:
            variance = t.variable("variance", 0)
            with t.loop("j", 0, i + 1) as j:
                variance.set(variance.get() + t.element("S", i * n + j) * t.element("S", i * n + j))
            t.guard(~t.finite(variance.get()), "NOT_FINITE")
        t.section("columns may change their sign: the diagonal is kept positive")
        with t.loop("i", 0, n) as i, t.loop("j", 0, i + 1) as j:
            value = t.name(t.element("S", i * n + j), "value")
            t.store("kf.S", upper_start(i) + j, select(t.element("S", j * n + j) < 0, -value, value))
        if outdated:
            t.store(outdated, None, t.wrapped(t.pool.boolean(False)))
        doc = "lower triangular root, row-major; the lower triangle is read"
        argument = Argument("S", "{name}_real_t", pointer=True, size=n * n, doc=doc)
        return Function(
            "set_sqrt_covariance", [KF, argument], schedule(t, taken | {"x", "S"}),
            "Replace the covariance by S S^T; the state stays.",
        )  # fmt: skip

    def _get_root(self, taken: frozenset[str]) -> Function:
        t, n = Trace(), self.n
        with t.loop("i", 0, n) as i:
            with t.loop("j", 0, i + 1) as j:
                t.store("S", i * n + j, t.element("kf.S", upper_start(i) + j))
            with t.loop("j", i + 1, n) as j:
                t.store("S", i * n + j, t.zero)
        doc = "lower triangular root, row-major"
        argument = Argument("S", "{name}_real_t", pointer=True, constant=False, size=n * n, doc=doc)
        return Function(
            "get_sqrt_covariance", [CONST_KF, argument], schedule(t, taken | {"x", "S"}),
            "The lower Cholesky factor of the covariance, in the order of the states.", returns="void",
        )  # fmt: skip

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij for counters i <= j, summed in a loop."""
        total = t.variable("sum", t.zero)
        with t.loop("k", j, self.n) as k:
            total.set(total.get() + t.element("kf.S", self.place(i, k)) * t.element("kf.S", self.place(j, k)))
        return total.get()

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store the root of a covariance given by its factors (D on the diagonal, U above)."""
        with t.loop("j", 0, self.n) as j:
            root = t.name(sqrt(factors[upper_start(j) + j]), "root")
            t.store("kf.S", self.place(j, j), root)
            if self.n > 1:
                with t.loop("i", 0, j) as i:
                    t.store("kf.S", self.place(i, j), factors[upper_start(j) + i] * root)

    def isolate(self, t: Trace, variances: Mapping[int, Value], in_loops: bool) -> None:
        """See `kernels.isolate`."""
        n = self.n
        if in_loops:
            kernel = isolate_root(Kernels(Fraction(t.smallest), frozenset()), n)
            for place, variance in variances.items():
                t.call(kernel, [("kf.S", 0), integer(t, n - 1 - place), variance])
            return
        S: Rows = [[t.element("kf.S", upper(j, i)) if j <= i else t.zero for j in range(n)] for i in range(n)]
        for inner, variance in variances.items():
            own = n - 1 - inner
            w: Vector = [S[i][own] for i in range(n)]
            for i in range(n):
                S[i][own] = S[own][i] = t.zero
            S[own][own] = sqrt(assume_nonnegative(variance))
            for j in range(own + 1, n):
                d, s = S[j][j], w[j]
                r = t.value(sqrt(d * d + s * s))
                some, inverse = reciprocal(r)
                c, s, S[j][j] = select(some, d * inverse, 1), s * inverse, r
                for i in range(j + 1, n):
                    S[i][j], w[i] = c * S[i][j] + s * w[i], c * w[i] - s * S[i][j]
        for i in range(n):
            for j in range(i + 1):
                t.store("kf.S", upper(j, i), t.value(S[i][j]))

    def root_array(self, t: Trace, own: Array | None = None) -> Array:
        """The columns of S, one after another. own: an array in place of the field."""
        n = self.n
        out = t.array(t.unique("root"), n * n)
        with t.loop("j", 0, n) as j:
            with t.loop("i", 0, j) as i:
                out[j * n + i] = 0
            with t.loop("i", j, n) as i:
                place = upper_start(i) + j
                out[j * n + i] = t.element("kf.S", place) if own is None else own[place]
        return out
