"""Sigma points of filters that are emitted as loops throughout: how they are drawn, and a covariance gathered."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.numbers import assume_nonnegative, is_zero
from kfgen.filters.covariance.base import Covariance
from kfgen.filters.covariance.full.loops import RolledFull
from kfgen.filters.covariance.full.terms import Entries
from kfgen.filters.covariance.kernels.points import pivots
from kfgen.filters.covariance.looped import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.sqrt.loops import RolledSqrt, Root
from kfgen.filters.covariance.ud.loops import Factors, RolledUD
from kfgen.filters.frame import guards
from kfgen.filters.frame.triangles import upper_start
from kfgen.filters.sigma.points import PointSet
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value

Weight = Value | Fraction


def scatter(t: Trace, cloud: Array, points: PointSet, columns: Array, n: int) -> None:
    """Points of any set: rows of coefficients, from a table, times the columns of the root."""
    table = tuple(coefficient for row in points.rows for coefficient in row)
    with t.loop("k", 0, len(points.rows)) as k, t.loop("i", 0, n) as i:
        total = t.variable("total", 0)
        with t.loop("j", 0, n) as j:
            total.set(total.get() + t.constants(table, k * n + j, "draws") * columns[j * n + i])
        cloud[k * n + i] = total.get()


def definite(layout: RolledFull, P: Entries, tolerance: Fraction) -> Entries:
    """P, after a guard that it is positive semidefinite up to `tolerance`, relative."""
    P = layout.written(P)
    t = P.space.t
    told = P.space.array("told", 1)
    t.call(pivots(layout.kernels, layout.n), [(P.array, 0), t.value(8 * tolerance), (told.name, 0)])
    guards.positive(t, [told[0] > 0])
    return P


class GatheredEntries:
    """A full P. columns: (w, d) of noise that is not additive. common: the weight of all points, if it is one."""

    def __init__(self, t: Trace, layout: RolledFull, Q: Additive, columns: list[tuple[Vector, Value]],
                 common: Fraction | None) -> None:  # fmt: skip
        self.t = t
        self.layout = layout
        self.n = n = layout.n
        self.Q = Q.entries()
        self.noise = columns
        self.common = common
        self.outside: list[tuple[Vector, Weight]] = []
        self.space = Space(t)
        self.sum = self.space.array("sum", n * (n + 1) // 2)
        with t.loop("i", 0, n * (n + 1) // 2) as i:
            self.sum[i] = 0

    def add_row(self, array: Array, at: Value, weight: Weight) -> None:
        """+ weight d d^T of the deviations from `at` on; a common weight comes in at the end."""
        t = self.t
        with t.loop("j", 0, self.n) as j:
            d = array[at + j]
            part = t.name(d if self.common is not None else d * weight, "part")
            with t.loop("i", 0, j + 1) as i:
                place = upper_start(j) + i
                self.sum[place] = self.sum[place] + array[at + i] * part

    def subtract_row(self, array: Array, at: Value, weight: Weight) -> None:
        self.add_row(array, at, -weight)

    def add(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, weight))

    def subtract(self, d: Vector, weight: Weight) -> None:
        self.outside.append((d, -weight))

    def result(self) -> tuple[Covariance, list[Value]]:
        t, n = self.t, self.n
        arrays: list[tuple[Array, Weight]] = []
        for d, weight in self.outside:
            array = self.space.array(f"outside{len(arrays)}", n)
            fill(t, array, d)
            arrays.append((array, weight))
        if arrays or self.common is not None:
            with t.loop("j", 0, n) as j:
                parts = [t.name(t.value(linalg.times(array[j], weight)), "part") for array, weight in arrays]
                with t.loop("i", 0, j + 1) as i:
                    place = upper_start(j) + i
                    total = self.sum[place] if self.common is None else self.sum[place] * self.common
                    for (array, _), part in zip(arrays, parts, strict=True):
                        total = total + array[i] * part
                    self.sum[place] = total
        self.layout.add_noise(t, self.sum, self.Q, self.noise, square=False)
        return Entries(self.space, self.sum.name), []


class GatheredFactors:
    """U D U^T, or its root, by private functions that absorb a column or take one away."""

    def __init__(self, t: Trace, layout: RolledUD | RolledSqrt, Q: Additive, columns: list[tuple[Vector, Value]],
                 absorb: Function, epsilon: Fraction) -> None:  # fmt: skip
        self.t = t
        self.layout = layout
        self.n = layout.n
        self.absorb = absorb
        self.tolerance = 8 * layout.n * epsilon
        self.space = Space(t)
        self.failures: list[Value] = []
        self.depth = t.depth
        layout.absorber.start(t, self.space, Q)
        self.w = self.space.array("w", self.n)
        for w, d in columns:
            self.add(w, assume_nonnegative(d))

    def _row(self, target: Array, array: Array, at: Value) -> None:
        straight = self.layout.order == list(range(self.n))
        with self.t.loop("i", 0, self.n) as i:
            target[i] = array[at + i] if straight else array[at + ((self.n - 1) - i)]

    def add_row(self, array: Array, at: Value, weight: Weight) -> None:
        """+ weight d d^T of the deviations from `at` on."""
        self._row(self.w, array, at)
        self._call(weight)

    def add(self, d: Vector, weight: Weight) -> None:
        fill(self.t, self.w, d)
        self._call(weight)

    def _call(self, weight: Weight) -> None:
        U, D = self.layout.absorber.arrays(self.space)
        self.t.call(self.absorb, [(U.name, 0), (D.name, 0), (self.w.name, 0), self.t.value(weight)])

    def subtract_row(self, array: Array, at: Value, weight: Weight) -> None:
        """- weight d d^T; nothing has been stored yet."""
        t = self.t
        total = t.variable("size", 0)
        with t.loop("i", 0, self.n) as i:
            total.set(total.get() + array[at + i])
        guards.finite(t, [total.get()])
        c = self.space.array("c", self.n)
        self._row(c, array, at)
        t.guard(self._removed(c, weight), "NOT_POSITIVE")

    def subtract(self, d: Vector, weight: Weight) -> None:
        c = self.space.array("c", self.n)
        fill(self.t, c, d)
        self.failures.append(self._removed(c, weight))

    def _removed(self, c: Array, weight: Weight) -> Value:
        return self.layout.absorber.remove(self.space, c, 1 / self.t.value(weight), self.tolerance, None)

    def result(self) -> tuple[Covariance, list[Value]]:
        if isinstance(self.layout, RolledSqrt):
            self.t.section("roots")
            self.layout.take_roots(self.space)
            return Root(self.space, own=True), self.failures
        return Factors(self.space, own=True), self.failures


Gathered = GatheredEntries | GatheredFactors


def gathered(t: Trace, layout: Covariance, Q: Additive, columns: list[tuple[Vector, Value]], common: Fraction | None,
             absorb: Function | None, epsilon: Fraction) -> Gathered:  # fmt: skip
    """A gatherer for the layout."""
    if isinstance(layout, RolledFull):
        return GatheredEntries(t, layout, Q, columns, common)
    assert absorb is not None
    return GatheredFactors(t, layout, Q, [c for c in columns if not is_zero(c[1])], absorb, epsilon)
