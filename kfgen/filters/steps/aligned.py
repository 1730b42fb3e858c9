"""A constant direction seen from a body, R(q)^T m with noise r I: turned so that one of three rows measures nothing.

With (m / |m|, a, b) orthonormal and C their rows, C R y has the rows a and b alone, and the noise r I: R r I R^T = r I.
Three scalar measurements become two, and a residual that only counts in nis.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from kfgen.filters.algebra.dual import state_seeds
from kfgen.filters.algebra.linalg import Vector, dot, times
from kfgen.filters.algebra.numbers import constant_root, is_zero
from kfgen.filters.steps.sensor import Linearised, SensorCode
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.model.rotations import RotationModel

Direction = tuple[Fraction, Fraction, Fraction]


def aligned(code: SensorCode, linear: Linearised, x: list[Value]) -> Linearised:
    """The same measurement, turned where it is such a one; as it is where options judge its components."""
    t, model, sensor = code.t, code.model, code.sensor
    found = _direction(model, sensor)
    R = linear.R
    variance = R[0][0]
    if found is None or not _isotropic(linear) or not _plain(model, sensor):
        return linear
    rotation, m = found
    attitude = state_seeds(t, model, x)[rotation.parts[0]].attitude
    size, basis = _basis(m)
    rows = [[t.value(dot(list(c), [attitude.rows[i][j] for i in range(3)])) for j in range(3)] for c in basis]
    z = [t.field(f"z.{c.name}") for c in sensor.spec.components]
    y = [t.value(dot(row, z)) for row in rows]
    y[0] = y[0] - size
    for value, name in zip(y, ("along", "across", "aside"), strict=True):
        t.name(value, f"y_{name}")
    H: list[Vector] = []
    for place, sign in ((None, 0), (2, -1), (1, 1)):
        h: Vector = [t.zero] * len(model.errors)
        if place is not None:
            seen: Vector = rows[place] if rotation.geometry.body else list(basis[place])
            for k in range(3):
                h[rotation.first_error + k] = t.value(times(seen[k], sign * size))
        H.append([h[i] for i in code.order])
    zero = t.zero
    return replace(linear, y=y, H=H, R=[[variance if i == j else zero for j in range(3)] for i in range(3)])


def _plain(model: Model, sensor: SensorModel) -> bool:
    options = model.options
    judging = (options.influence, options.inflation, options.adapt_R, options.innovation_floor, options.gain_limit)
    return not sensor.spec.partial and not options.consider and all(each is None for each in judging)


def _isotropic(linear: Linearised) -> bool:
    R, m = linear.R, len(linear.R)
    same = all(R[i][i].node is R[0][0].node for i in range(m))
    bare = all(is_zero(R[i][j]) for i in range(m) for j in range(m) if i != j)
    return same and bare and all(is_zero(v) for row in linear.added for v in row)


def _direction(model: Model, sensor: SensorModel) -> tuple[RotationModel, Direction] | None:
    """The quaternion and the constant m of a sensor that measures R(q)^T m; None: it does not."""
    if len(sensor.h) != 3 or any(r is not None for r in (*sensor.residual, *sensor.periods)):
        return None
    found: set[tuple[str, tuple[Fraction | None, ...]]] = set()
    lowering = Lowering(Trace(), {})
    for i, h in enumerate(sensor.h):
        names: set[str] = set()
        m: list[Fraction | None] = [Fraction(0)] * 3
        for term in h.as_ordered_terms():
            factor, symbol = term.as_independent(*term.free_symbols)
            what = model.turned.get(symbol.name) if symbol.is_Symbol else None
            if what is None or factor.free_symbols:
                return None
            names.add(what.rotation)
            if what.vector is not None and what.transposed and what.i == i and factor == 1:
                if any(e.free_symbols for e in what.vector):
                    return None
                m = [lowering(e).constant for e in what.vector]
            elif what.vector is None and what.j == i:
                m[what.i] = lowering(factor).constant
            else:
                return None
        if len(names) != 1:
            return None
        found.add((names.pop(), tuple(m)))
    if len(found) != 1:
        return None
    name, (a, b, c) = found.pop()
    if a is None or b is None or c is None or not (a or b or c):
        return None
    return next(r for r in model.rotations if r.name == name), (a, b, c)


def _basis(m: Direction) -> tuple[Fraction, list[Direction]]:
    """|m|, and a right-handed basis that begins with its direction, along axes where that can be."""
    size = constant_root(m[0] ** 2 + m[1] ** 2 + m[2] ** 2)
    u = _scaled(m, 1 / size)
    axis = min(range(3), key=lambda i: (abs(m[i]), i))
    start: Direction = tuple(Fraction(int(i == axis)) for i in range(3))  # type: ignore[assignment]
    rest = _cross(u, start)
    across = _scaled(rest, 1 / constant_root(sum((v * v for v in rest), Fraction(0))))
    return size, [u, _cross(across, u), across]


def _scaled(v: Direction, factor: Fraction) -> Direction:
    return (v[0] * factor, v[1] * factor, v[2] * factor)


def _cross(a: Direction, b: Direction) -> Direction:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
