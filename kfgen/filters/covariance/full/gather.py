"""A full covariance gathered from sigma points in loops; Q added to it; whether it is indefinite."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.linalg import Rows, Vector, plus, times
from kfgen.filters.algebra.numbers import Number, is_zero
from kfgen.filters.algebra.triangles import upper, upper_start
from kfgen.filters.covariance.full.terms import ArrayEntries
from kfgen.filters.covariance.kernels.function import Kernels
from kfgen.filters.covariance.kernels.points import pivots
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Weight
from kfgen.filters.frame.runs import put
from kfgen.ir.trace import Array, Trace, Value


class LoopedEntries:
    """A full P, in a packed array. columns: (w, d) of noise that is not additive."""

    rewrites = True

    def __init__(
        self, t: Trace, kernels: Kernels, Q: Additive, columns: list[tuple[Vector, Value]], how: Gathering
    ) -> None:
        self.t = t
        self.kernels = kernels
        self.how = how
        self.n = n = len(how.names)
        self.Q = Q.entries()
        self.noise = columns
        self.common = how.common
        self.outside: list[tuple[Vector, Weight]] = []
        self.space = Space(t)
        self.sum = self.space.array("sum", n * (n + 1) // 2)
        with t.loop("i", 0, n * (n + 1) // 2) as i:
            self.sum[i] = 0

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """+ weight d d^T of the deviations from `at` on; a common weight comes in at the end."""
        t = self.t
        with t.loop("j", 0, self.n) as j:
            own = array[at + j]
            part = t.name(own if self.common is not None else own * weight, "part")
            with t.loop("i", 0, j + 1) as i:
                place = upper_start(j) + i
                self.sum[place] = self.sum[place] + array[at + i] * part

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        self.add_row(array, at, d, -weight)

    def add(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, weight))

    def subtract(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, -weight))

    def result(self) -> tuple[ArrayEntries, list[Value]]:
        t, n = self.t, self.n
        arrays: list[tuple[Array, Weight]] = []
        for d, weight in self.outside:
            array = self.space.array(f"outside{len(arrays)}", n)
            fill(t, array, d)
            arrays.append((array, weight))
        if arrays or self.common is not None:
            with t.loop("j", 0, n) as j:
                parts = [t.name(t.value(times(array[j], weight)), "part") for array, weight in arrays]
                with t.loop("i", 0, j + 1) as i:
                    place = upper_start(j) + i
                    total = self.sum[place] if self.common is None else self.sum[place] * self.common
                    for (array, _), part in zip(arrays, parts, strict=True):
                        total = total + array[i] * part
                    self.sum[place] = total
        add_noise(t, self.sum, self.Q, self.noise, square=False)
        P = ArrayEntries(self.space, n, self.kernels, self.sum.name)
        return P, [indefinite(P, n * self.how.epsilon)] if self.how.checked else []


def add_noise(t: Trace, a: Array, Q: Rows, noise: list[tuple[Vector, Value]], square: bool) -> None:
    """Q and d w w^T, entry by entry where they are sparse, the upper triangle of a square or a packed array."""
    n = len(Q)
    sparse: dict[tuple[int, int], Value] = {}
    kept = _kept(Q)
    for row in range(n):
        for col in range(row, n):
            total: Number = 0 if kept else Q[row][col]
            for w, d in noise:
                total = plus(total, times(times(w[row], d), w[col]))
            if not is_zero(total):
                sparse[row, col] = t.value(total)
    if kept:
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            spot = j * n + i if square else upper_start(j) + i
            a[spot] = a[spot] + t.element(kept, upper_start(j) + i)

    def add(i: int | Value, value: Value) -> None:
        at = i * (n + 1) if square else upper(0, i) + i if isinstance(i, int) else upper_start(i) + i
        a[at] = a[at] + value

    put(t, add, {row: v for (row, col), v in sparse.items() if row == col})
    for (row, col), value in sparse.items():
        if row != col:
            at = col * n + row if square else upper(row, col)
            a[at] = a[at] + value


def _kept(Q: Rows) -> str:
    """The field that holds all of Q, packed as P is; empty: none."""
    node = Q[0][0].node if isinstance(Q[0][0], Value) else None
    if node is None or node.op != "element":
        return ""
    for j in range(len(Q)):
        for i in range(j + 1):
            other = Q[i][j].node if isinstance(Q[i][j], Value) else None
            if other is None or other.op != "element" or other.data != node.data:
                return ""
            if other.args[0].constant != upper(i, j):
                return ""
    return str(node.data)


def indefinite(P: ArrayEntries, tolerance: Fraction) -> Value:
    """Whether a pivot of P, which is written, is negative by more than `tolerance`, relative, leaves."""
    t = P.space.t
    told = P.space.array("told", 1)
    t.call(pivots(P.kernels, P.n), [(P.array, 0), t.value(8 * tolerance), (told.name, 0)])
    return told[0] > 0
