"""Sigma points of many states: the same linear algebra in loops over arrays, for size and not for speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import assume_nonnegative, is_zero, select, sqrt
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.base import Covariance, Layout
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.frame.triangles import strict_start, upper_start
from kfgen.filters.sigma.points import PointSet
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value

FROM = 9  # states from which on loops are used; straight-line code would be 10 kB and more

Weight = Value | Fraction
Element = Callable[[str, Value], Value]


def root(t: Trace, layout: Layout, tolerance: Fraction, own: Mapping[str, Array] | None = None) -> Array:
    """A local array with the columns of a root of the stored covariance, column after column, in the spec's order.

    own: arrays that hold another covariance as the fields of the struct do.
    """
    n = layout.n

    def of(path: str, index: Value) -> Value:
        return t.element(path, index) if own is None else own[path][index]

    out = t.array(t.unique("root"), n * n)
    with t.loop("j", 0, n) as j:
        if not layout.factored:
            _cholesky_column(t, n, out, j, tolerance, of)
            with t.loop("i", 0, j) as i:
                out[j * n + i] = 0
        elif layout.reorders:  # U D U^T
            scale = t.name(sqrt(assume_nonnegative(of("kf.D", j))), "scale")
            with t.loop("i", 0, j) as i:
                out[j * n + i] = of("kf.U", strict_start(j) + i) * scale
            out[j * n + j] = scale
            with t.loop("i", j + 1, n) as i:
                out[j * n + i] = 0
        else:
            with t.loop("i", 0, j) as i:
                out[j * n + i] = 0
            with t.loop("i", j, n) as i:
                out[j * n + i] = of("kf.S", upper_start(i) + j)
    return out


def _cholesky_column(t: Trace, n: int, out: Array, j: Value, tolerance: Fraction, of: Element
) -> None:  # fmt: skip
    """Column j of the lower root of P, those before it being known."""
    diagonal = t.name(of("kf.P", upper_start(j) + j), "diagonal")
    pivot = t.variable("pivot", diagonal)
    with t.loop("k", 0, j) as k:
        pivot.set(pivot.get() - out[k * n + j] * out[k * n + j])
    left = t.name(pivot.get(), "left")
    limit = t.name(diagonal * tolerance, "limit")
    t.guard(~(left >= -limit), "NOT_POSITIVE")
    length = t.name(sqrt(select(left > limit, left, 0)), "length")
    inverse = t.name(select(left > limit, 1 / length, 0), "inverse")
    out[j * n + j] = length
    with t.loop("i", j + 1, n) as i:
        rest = t.variable("rest", of("kf.P", upper_start(i) + j))
        with t.loop("k", 0, j) as k:
            rest.set(rest.get() - out[k * n + i] * out[k * n + j])
        out[j * n + i] = rest.get() * inverse


def scatter(t: Trace, cloud: Array, points: PointSet, columns: Array, n: int, noise: Rows) -> None:
    """Points x +- reach times the columns of the root and of that of the carried noises (symmetric sets)."""
    q = len(noise)
    stride = n + q
    reach = max(points.rows[0])
    with t.loop("j", 0, n) as j:
        with t.loop("i", 0, n) as i:
            part = t.name(columns[j * n + i] * reach, "part")
            cloud[2 * j * stride + i] = part
            cloud[(2 * j + 1) * stride + i] = -part
        for k in range(n, stride):
            cloud[2 * j * stride + k] = 0
            cloud[(2 * j + 1) * stride + k] = 0
    for c in range(q):
        for sign, row in ((1, 2 * (n + c)), (-1, 2 * (n + c) + 1)):
            for k in range(n):
                cloud[row * stride + k] = 0
            for k in range(q):
                value = noise[k][c]
                cloud[row * stride + n + k] = t.value(0 if is_zero(value) else value * (sign * reach))


class Entries:
    """A full P gathered from deviations that stand in an array."""

    def __init__(self, t: Trace, layout: Layout, Q: Additive, columns: list[tuple[Vector, Value]], common: Fraction
                 ) -> None:  # fmt: skip
        self.t = t
        self.n = layout.n
        self.common = common
        self.Q = Q.entries()
        self.outside: list[tuple[Vector, Weight]] = list(columns)
        self.sum = t.array("sum", self.n * (self.n + 1) // 2)
        with t.loop("i", 0, self.n * (self.n + 1) // 2) as i:
            self.sum[i] = 0

    def add_row(self, array: Array, at: Value) -> None:
        """+ d d^T of the deviations from `at` on; the common weight comes in at the end."""
        with self.t.loop("j", 0, self.n) as j, self.t.loop("i", 0, j + 1) as i:
            place = upper_start(j) + i
            self.sum[place] = self.sum[place] + array[at + i] * array[at + j]

    def add(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, weight))

    def result(self) -> tuple[Covariance, list[Value]]:
        t = self.t

        def entry(i: int, j: int) -> Value:
            total: Value = t.value(linalg.plus(self.sum[j * (j + 1) // 2 + i] * self.common, self.Q[i][j]))
            for d, weight in self.outside:
                total = t.value(linalg.plus(total, linalg.times(linalg.times(d[i], weight), d[j])))
            return total

        return Symmetric(self.n, entry), []


class Factors:
    """U D U^T gathered likewise, by a private function that absorbs one column."""

    def __init__(self, t: Trace, layout: Layout, Q: Additive, columns: list[tuple[Vector, Value]], common: Fraction,
                 absorb: Function) -> None:  # fmt: skip
        self.t = t
        self.layout = layout
        n = self.n = layout.n
        self.common = common
        self.absorb = absorb
        U, D = Q.factors()
        for w, d in columns:
            rank_one(U, D, [(w, assume_nonnegative(d), -1)], safe=True)
        self.U, self.D = t.array("factor", n * (n - 1) // 2), t.array("diagonal", n)
        self.w = t.array("w", n)
        for j in range(n):
            for i in range(j):
                self.U[j * (j - 1) // 2 + i] = t.value(U[i][j])
            self.D[j] = t.value(D[j])

    def add_row(self, array: Array, at: Value) -> None:
        """+ w d d^T of the deviations from `at` on, w the common weight."""
        straight = self.layout.order == list(range(self.n))
        with self.t.loop("i", 0, self.n) as i:
            self.w[i] = array[at + i] if straight else array[at + ((self.n - 1) - i)]
        self._call(self.t.value(self.common))

    def add(self, d: Vector, weight: Weight) -> None:
        for i, x in enumerate(d):
            self.w[i] = self.t.value(x)
        self._call(self.t.value(weight))

    def _call(self, weight: Value) -> None:
        self.t.call(self.absorb, [(self.U.name, 0), (self.D.name, 0), (self.w.name, 0), weight])

    def result(self) -> tuple[Covariance, list[Value]]:
        n, t = self.n, self.t
        U: Rows = [[self.U[j * (j - 1) // 2 + i] if i < j else t.zero for j in range(n)] for i in range(n)]
        D = [assume_nonnegative(self.D[j]) for j in range(n)]
        return self.layout.from_factors(t, U, D), []


def absorb(n: int, smallest: Fraction, taken: frozenset[str]) -> Function:
    """U D U^T += weight w w^T (Agee & Turner 1972), as `rank_one`."""
    t = Trace(smallest)
    weight = t.variable("left", t.field("weight"))
    with t.loop("j", 0, n, down=True) as j:
        s = t.name(t.element("w", j), "s")
        d = t.name(t.element("diagonal", j), "d")
        v = t.name(weight.get() * s, "v")
        a = t.name(d + s * v, "a")
        some = t.name(a > smallest, "some")
        b = t.name(select(some, v / a, 0), "b")
        ratio = t.name(select(some, d / a, 1), "ratio")
        t.store("diagonal", j, a)
        with t.loop("i", 0, j) as i:
            place = strict_start(j) + i
            u = t.name(t.element("factor", place), "u")
            w = t.name(t.element("w", i), "w_i")
            t.store("w", i, w - s * u)
            t.store("factor", place, ratio * u + b * w)
        weight.set(weight.get() * ratio)
    arrays = [Argument(name, "{name}_real_t", pointer=True, constant=False, size=size)
              for name, size in (("factor", n * (n - 1) // 2), ("diagonal", n), ("w", n))]  # fmt: skip
    number = Argument("weight", "{name}_real_t", pointer=False)
    return Function(
        "absorb", [*arrays, number], schedule(t, taken | {"factor", "diagonal", "w", "weight", "x", "kf"}),
        "U D U^T += weight w w^T; w is used up", returns="void", private=True,
    )  # fmt: skip
