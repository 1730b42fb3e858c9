"""Quaternions in formulas (Hamilton, scalar first, body to reference), reduced to entries of R(q), exp and log.

Markley & Crassidis 2014, chapter 2, with the signs of Sola 2017.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from kfgen.spec.shaping.extents import (
    ONE,
    ROTATION,
    TWO,
    ZERO,
    Shaped,
    ShapeError,
    add,
    column,
    inner,
    is_zero,
    length,
    matrix,
    mul,
    neg,
    number,
    square,
    sub,
    total,
)
from kfgen.spec.tree import Call, Number, Tree

Share = Callable[[Shaped], Shaped]
# of 2 (1 + cos): below it two directions are opposite, and the axis of what turns one into the other is any
_OPPOSITE = Number(Fraction(1, 10**10))


def _index(i: int) -> Tree:
    return Number(Fraction(i))


def quaternion(name: str, q: Shaped) -> Shaped:
    """A quaternion; four numbers stand for one."""
    if q.extent.kind not in ("vector", "quaternion") or q.extent.rows != 4:
        hint = "write the quaternion first: `rotate(q, v)`" if name.endswith("rotate") else "write a quaternion"
        raise ShapeError(f"`{name}` wants a quaternion, not {q.extent}", hint)
    return q


def three(name: str, v: Shaped) -> Shaped:
    if v.extent.kind != "vector" or v.extent.rows != 3:
        hint = "the quaternion comes first: `rotate(q, v)`" if v.extent == ROTATION else "write three numbers"
        raise ShapeError(f"`{name}` wants a 3-vector, not {v.extent}", hint)
    return v


def entry(q: Shaped, i: int, j: int) -> Tree:
    """R(q)_ij."""
    return Call("rotation", (_index(i), _index(j), *q.parts))


def product(a: Shaped, b: Shaped) -> Shaped:
    """a b: the rotation b, then a."""
    aw, ax, ay, az = a.parts
    bw, bx, by, bz = b.parts
    return Shaped(
        ROTATION,
        (
            sub(sub(sub(mul(aw, bw), mul(ax, bx)), mul(ay, by)), mul(az, bz)),
            sub(add(add(mul(aw, bx), mul(ax, bw)), mul(ay, bz)), mul(az, by)),
            add(add(sub(mul(aw, by), mul(ax, bz)), mul(ay, bw)), mul(az, bx)),
            add(sub(add(mul(aw, bz), mul(ax, by)), mul(ay, bx)), mul(az, bw)),
        ),
    )


def conjugate(q: Shaped, share: Share) -> Shaped:
    w, *rest = quaternion("conjugate", q).parts
    return Shaped(ROTATION, (w, *map(neg, rest)))


def rotate(q: Shaped, v: Shaped, share: Share) -> Shaped:
    """R(q) v."""
    q, v = share(quaternion("rotate", q)), share(three("rotate", v))
    return column([inner([entry(q, i, j) for j in range(3)], v.parts) for i in range(3)])


def unrotate(q: Shaped, v: Shaped, share: Share) -> Shaped:
    """R(q)^T v."""
    q, v = share(quaternion("unrotate", q)), share(three("unrotate", v))
    return column([inner([entry(q, j, i) for j in range(3)], v.parts) for i in range(3)])


def rotation(q: Shaped, share: Share) -> Shaped:
    q = share(quaternion("rotation", q))
    return Shaped(matrix(3, 3), tuple(entry(q, i, j) for i in range(3) for j in range(3)))


def rotation_vector(q: Shaped, share: Share) -> Shaped:
    """The axis times the angle, 0 to pi."""
    q = share(quaternion("rotation_vector", q))
    return column([Call("rotation_vector", (_index(k), *q.parts)) for k in range(3)])


def from_rotation_vector(v: Shaped, share: Share) -> Shaped:
    v = share(three("from_rotation_vector", v))
    return Shaped(ROTATION, tuple(Call("from_rotation_vector", (_index(k), *v.parts)) for k in range(4)))


def roll(q: Shaped, share: Share) -> Shaped:
    q = share(quaternion("roll", q))
    return number(Call("atan2", (entry(q, 2, 1), entry(q, 2, 2))))


def pitch(q: Shaped, share: Share) -> Shaped:
    """By atan2: of an arc sine the argument may exceed 1 by a rounding."""
    q = share(quaternion("pitch", q))
    level = Call("hypot", (entry(q, 0, 0), entry(q, 1, 0)))
    return number(Call("atan2", (neg(entry(q, 2, 0)), level)))


def yaw(q: Shaped, share: Share) -> Shaped:
    q = share(quaternion("yaw", q))
    return number(Call("atan2", (entry(q, 1, 0), entry(q, 0, 0))))


def from_euler(r: Shaped, p: Shaped, y: Shaped, share: Share) -> Shaped:
    """z-y-x: the yaw first, about z."""
    for angle in (r, p, y):
        if angle.extent.kind != "number":
            raise ShapeError(f"`from_euler` wants three numbers, not {angle.extent}", "write roll, pitch, yaw in rad")
    halves = [share(number(Call("div", (angle.number, TWO)))).number for angle in (r, p, y)]
    (cr, sr), (cp, sp), (cy, sy) = ((Call("cos", (half,)), Call("sin", (half,))) for half in halves)
    return Shaped(
        ROTATION,
        (
            add(mul(mul(cr, cp), cy), mul(mul(sr, sp), sy)),
            sub(mul(mul(sr, cp), cy), mul(mul(cr, sp), sy)),
            add(mul(mul(cr, sp), cy), mul(mul(sr, cp), sy)),
            sub(mul(mul(cr, cp), sy), mul(mul(sr, sp), cy)),
        ),
    )


def rotation_between(a: Shaped, b: Shaped, share: Share) -> Shaped:
    """The shortest rotation that takes the direction a to that of b: (1 + a.b, a x b), normalised.

    Of opposite directions half a turn about an axis across a; where one is 0 none.
    """
    a, b = share(three("rotation_between", a)), share(three("rotation_between", b))
    u, v = share(column(unit(a.parts, share))).parts, share(column(unit(b.parts, share))).parts
    x, y, z = u
    steep = Call("gt", (square(x), square(z)))
    across = [Call("where", (steep, neg(y), ZERO)), Call("where", (steep, x, neg(z))),
              Call("where", (steep, ZERO, y))]  # fmt: skip
    return _turned(u, v, share(column(unit(share(column(across)).parts, share))).parts, share)


def triad(a: Shaped, b: Shaped, ra: Shaped, rb: Shaped, share: Share) -> Shaped:
    """Takes a to ra, and b into the half plane of ra and rb: the shortest from a to ra, then a turn about ra."""
    first = share(rotation_between(a, ra, share))
    b, rb = share(three("triad", b)), share(three("triad", rb))
    axis = share(column(unit(share(three("triad", ra)).parts, share))).parts
    u = _across(share(rotate(first, b, share)).parts, axis, share)
    v = _across(rb.parts, axis, share)
    return product(share(_turned(u, v, axis, share)), first)


def _across(v: Sequence[Tree], axis: Sequence[Tree], share: Share) -> tuple[Tree, ...]:
    """The direction of what of v lies across an axis."""
    along = share(number(inner(v, axis))).number
    rest = share(column([sub(p, mul(along, q)) for p, q in zip(v, axis, strict=True)])).parts
    return share(column(unit(rest, share))).parts


def _turned(u: Sequence[Tree], v: Sequence[Tree], axis: Sequence[Tree], share: Share) -> Shaped:
    """The rotation of the unit vector u to v; half a turn about the axis where they are opposite."""
    w = share(number(add(ONE, inner(u, v)))).number
    turn = share(column([sub(mul(u[i], v[j]), mul(u[j], v[i])) for i, j in ((1, 2), (2, 0), (0, 1))])).parts
    size = share(number(total([square(w), *map(square, turn)]))).number
    far = Call("gt", (size, _OPPOSITE))
    root = share(number(Call("sqrt", (size,)))).number
    pairs = zip((w, *turn), (ZERO, *axis), strict=True)
    return Shaped(ROTATION, tuple(Call("where", (far, Call("div", (p, root)), q)) for p, q in pairs))


def unit(parts: Sequence[Tree], share: Share) -> tuple[Tree, ...]:
    """parts / their length; 0 where that is 0."""
    size = share(number(length(parts))).number
    positive = Call("gt", (size, ZERO))
    return tuple(ZERO if is_zero(p) else Call("where", (positive, Call("div", (p, size)), ZERO)) for p in parts)
