"""Quaternions with the gradients of their errors: what R(q) turns, and steps on the rotation group.

The gradient of a rotation is that of its error: dq = q (w / 2) in the body's frame, (w / 2) q in the reference frame,
w (3,) per variable. |q| = 1 is used throughout.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property

from kfgen.filters.algebra.gradient import Dual, Gradient
from kfgen.filters.algebra.linalg import dot, minus, plus, times
from kfgen.filters.algebra.numbers import is_zero
from kfgen.geometry.rotation import Rotation, matrix, product
from kfgen.geometry.turn import Turn
from kfgen.ir.trace import Trace, Value

Three = Sequence[Dual]
HALF = Fraction(1, 2)


class Attitude:
    """q (4,) and the gradient of its error (3,). name: for the locals. held: nothing turns it."""

    def __init__(
        self, t: Trace, name: str, geometry: Rotation, q: Sequence[Value], error: Sequence[Gradient], held: bool = False
    ) -> None:
        self.held = held
        self.t = t
        self.name = name
        self.geometry = geometry
        self.q = list(q)
        self.error = list(error)

    @cached_property
    def rows(self) -> list[list[Value]]:
        """R(q)."""
        return [
            [self.t.name(self.t.value(r), f"{self.name}_r{i}{j}") for j, r in enumerate(row)]
            for i, row in enumerate(matrix(self.q))
        ]

    def variables(self, *others: Dual) -> list[str]:
        """What the error, or others, depend on; in a fixed order."""
        return list(dict.fromkeys(v for g in (*self.error, *(d.gradient for d in others)) for v in g))

    def along(self, variable: str) -> list[Value]:
        """The derivative of the error by a variable (3,)."""
        return [g.get(variable, self.t.zero) for g in self.error]

    def numbers(self) -> list[Dual]:
        """q as four numbers, which know what they are numbers of."""
        gradients: list[Gradient] = [{} for _ in range(4)]
        for variable in self.variables():
            half = [self.t.zero, *(e * HALF for e in self.along(variable))]
            for g, value in zip(gradients, self._beside(half), strict=True):
                if not is_zero(value):
                    g[variable] = value
        return [Dual(value, g, {}, self) for value, g in zip(self.q, gradients, strict=True)]

    def _beside(self, other: Sequence[Value]) -> list[Value]:
        found = product(self.q, other) if self.geometry.body else product(other, self.q)
        return [self.t.value(a) for a in found]

    def entry(self, i: int, j: int) -> Dual:
        """R_ij: dR = R [w]x, or [w]x R."""
        R, gradient = self.rows, dict[str, Value]()
        for variable in self.variables():
            w = self.along(variable)
            if self.geometry.body:  # column j of [w]x
                column = _crossed(w, j)
                value = dot(R[i], column)
            else:  # row i of [w]x is minus its column
                value = -dot(_crossed(w, i), [R[k][j] for k in range(3)])
            if not is_zero(value):
                gradient[variable] = self.t.value(value)
        return Dual(R[i][j], gradient)

    def turned(self, v: Three, i: int, transposed: bool) -> Dual:
        """Entry i of R v, or of R^T v."""
        t, R = self.t, self.rows
        row = [R[k][i] for k in range(3)] if transposed else R[i]
        value = t.value(dot(row, [d.value for d in v]))
        gradient: Gradient = {}
        inside = transposed != self.geometry.body  # whether w is in the frame that v is given in
        for variable in self.variables(*v):
            total = dot(row, [d.gradient.get(variable, t.zero) for d in v])
            w = self.along(variable)
            if not all(is_zero(e) for e in w):
                if inside:  # R (w x v), or R^T (v x w)
                    arms = cross(w, [d.value for d in v])
                    term = dot(row, arms)
                    total = minus(total, term) if transposed else plus(total, term)
                else:  # w x (R v), or (R^T v) x w
                    a, b = (i + 1) % 3, (i + 2) % 3
                    there = [self._whole(v, k, transposed) for k in (a, b)]
                    term = minus(times(w[a], there[1]), times(w[b], there[0]))
                    total = minus(total, term) if transposed else plus(total, term)
            if not is_zero(total):
                gradient[variable] = t.value(total)
        return Dual(value, gradient)

    def _whole(self, v: Three, i: int, transposed: bool) -> Value:
        row = [self.rows[k][i] for k in range(3)] if transposed else self.rows[i]
        return self.t.value(dot(row, [d.value for d in v]))

    def by(self, phi: Three, bound: Fraction | None, names: Sequence[str] = ()) -> Attitude:
        """q exp(phi), normalised."""
        t = self.t
        if self.held or all(is_zero(d.value) and not d.gradient for d in phi):
            return self
        turn = Turn([d.value for d in phi], bound)
        q = [t.value(a) for a in self.geometry.placed(product(self.q, turn.quaternion()))]
        for value, part in zip(q, names, strict=False):
            t.name(value, f"{part}_next")
        error: list[Gradient] = [{} for _ in range(3)]
        body = self.geometry.body
        back, right = turn.back(), turn.right()
        if not body:  # R(q) Jl(phi), on the other side of the turn
            left = turn.left()
            right = [[t.value(dot(self.rows[i], [row[j] for row in left])) for j in range(3)] for i in range(3)]
        for variable in self.variables(*phi):
            w, dphi = self.along(variable), [d.gradient.get(variable, t.zero) for d in phi]
            for i in range(3):
                own = dot(back[i], w) if body else w[i]
                value = plus(own, dot(right[i], dphi))
                if not is_zero(value):
                    error[i][variable] = t.value(value)
        return Attitude(t, self.name, self.geometry, q, error)


def of_numbers(t: Trace, name: str, geometry: Rotation, numbers: Sequence[Dual]) -> Attitude:
    """Four numbers of any norm as a rotation."""
    q = [d.value for d in numbers]
    squares = t.name(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], "norm_2")
    inverse = t.name(1 / t.function("sqrt", squares), "inverse_norm")
    q = [t.value(a * inverse) for a in q]
    error: list[Gradient] = [{} for _ in range(3)]
    for variable in dict.fromkeys(v for d in numbers for v in d.gradient):
        moved = [d.gradient.get(variable, t.zero) for d in numbers]
        back = [q[0], -q[1], -q[2], -q[3]]
        found = (product(back, moved) if geometry.body else product(moved, back))[1:]
        for g, value in zip(error, found, strict=True):
            if not is_zero(value):
                g[variable] = t.value(2 * inverse * value)
    return Attitude(t, name, geometry, q, error)


def cross(a: Sequence[Value], b: Sequence[Value]) -> list[Value]:
    return [minus(times(a[i], b[j]), times(a[j], b[i])) for i, j in _pairs()]


def dual_cross(a: Three, b: Three) -> list[Dual]:
    """a x b with its gradient."""
    out = []
    for i, j in _pairs():
        value = a[i].value * b[j].value - a[j].value * b[i].value
        gradient: Gradient = {}
        for variable in dict.fromkeys(v for d in (a[i], b[j], a[j], b[i]) for v in d.gradient):
            zero = value.trace.zero
            ai, aj, bi, bj = (d.gradient.get(variable, zero) for d in (a[i], a[j], b[i], b[j]))
            total = ai * b[j].value + a[i].value * bj - aj * b[i].value - a[j].value * bi
            if not is_zero(total):
                gradient[variable] = total
        out.append(Dual(value, gradient))
    return out


def _pairs() -> Iterator[tuple[int, int]]:
    return iter(((1, 2), (2, 0), (0, 1)))


def _crossed(w: Sequence[Value], j: int) -> list[Value]:
    """Column j of [w]x: w x e_j."""
    x, y, z = w
    zero = x.trace.zero
    return [[zero, z, -y], [-z, zero, x], [y, -x, zero]][j]
