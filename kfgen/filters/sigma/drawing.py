"""Sigma points drawn of a covariance, into an array that holds, point after point, what each adds to the mean."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.factors import cholesky, root_of_factors, udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_constant, is_zero, require_nonnegative, select
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.noise import NEGATIVE
from kfgen.filters.covariance.parts import Columns
from kfgen.filters.sigma.cloud import fill
from kfgen.filters.sigma.points import PointSet
from kfgen.ir.trace import Array, Trace, Value

FROM = 9  # states from which on loops are used; straight-line code would be 10 kB and more


@dataclass(frozen=True)
class Drawing:
    """Draws the points of a filter. tolerance: a pivot up to this part of its diagonal is a direction without spread.

    in_loops: whether that is done in loops where P stands in the struct.
    """

    form: Form[Any]
    tolerance: Fraction
    in_loops: bool

    def scatter(
        self, t: Trace, P: Any, noise: Rows, points: PointSet, array: Array, stored: bool = True
    ) -> list[Value]:
        """Write points of P (n, n) and of carried noises, of which `noise` (q, q) is a root, into the array;
        conditions of failure. stored: P is that of the struct."""
        root = self.form.root(t, P, self.tolerance, stored, self.in_loops)
        return self._written(t, root, noise, points, array)

    def _written(self, t: Trace, root: Array | Columns, noise: Rows, points: PointSet, array: Array) -> list[Value]:
        if isinstance(root, Columns):
            fill(t, array, points, self._columns(t, root, noise))
            return root.failures
        if points.symmetric:
            _spread(t, array, points, root, self.form.n, noise)
        else:
            _combine(t, array, points, root, self.form.n)
        return []

    def around(self, t: Trace, P: Any, noise: Rows, points: PointSet, array: Array, x: list[Value]) -> list[Value]:
        """Write points about x (n,), of the P of the struct; conditions of failure."""
        n, stride = self.form.n, self.form.n + len(noise)
        root = self.form.root(t, P, self.tolerance, True, self.in_loops)
        middle = [*x, *[t.zero] * len(noise)]
        if isinstance(root, Columns) and points.symmetric:
            fill(t, array, points, self._columns(t, root, noise), step=2)
            with t.loop("j", 0, len(points.rows) // 2) as j:
                at = 2 * j * stride
                for i, value in enumerate(middle):
                    part = t.name(array[at + i], f"part_{i}")
                    array[at + i] = value + part
                    array[at + (stride + i)] = value - part
            return root.failures
        failures = self._written(t, root, noise, points, array)
        with t.loop("j", 0, len(points.rows)) as j:
            for i in range(n):
                array[j * stride + i] = array[j * stride + i] + x[i]
        return failures

    def _columns(self, t: Trace, root: Columns, noise: Rows) -> list[Vector]:
        """Columns (n + q) of a root of P, in the spec's order, and of the noises'."""
        n, q = self.form.n, len(noise)
        out: list[Vector] = []
        for column in root.columns:
            straight: Vector = [0] * n
            for place, value in zip(self.form.order, column, strict=True):
                straight[place] = value
            out.append([*straight, *[0] * q])
        for j in range(q):
            out.append([*[0] * n, *[noise[i][j] for i in range(q)]])
        return [[v if isinstance(v, Value) else t.value(v) for v in column] for column in out]


def _spread(t: Trace, cloud: Array, points: PointSet, columns: Array, n: int, noise: Rows) -> None:
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


def _combine(t: Trace, cloud: Array, points: PointSet, columns: Array, n: int) -> None:
    """Points of any set: rows of coefficients, from a table, times the columns of the root."""
    table = tuple(coefficient for row in points.rows for coefficient in row)
    with t.loop("k", 0, len(points.rows)) as k, t.loop("i", 0, n) as i:
        total = t.variable("total", 0)
        with t.loop("j", 0, n) as j:
            total.set(total.get() + t.constants(table, k * n + j, "draws") * columns[j * n + i])
        cloud[k * n + i] = total.get()


def noise_root(C: Rows, form: str, tolerance: Fraction) -> tuple[Rows, list[Value]]:
    """A root of the covariance of noise inputs (q, q), of the kind that the form of the covariance has; and what of C
    has to be tested to be finite. That C is a covariance is left to a guard."""
    values = [v for row in C for v in row if v.constant is None]
    if not C:
        return [], values
    U, D = udu(C)
    for d in D:
        require_nonnegative(d, NEGATIVE)
    if form == "ud":
        D = [d if is_constant(d) else select(d > 0, d, 0) for d in D]
        return root_of_factors(U, D), values
    S, _ = cholesky(lambda i, j: C[i][j], len(C), tolerance)
    return S, values
