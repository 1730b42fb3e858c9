"""Operators and functions of numbers, vectors and matrices, part by part or as products: typed by shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kfgen.spec.shaping.extents import (
    MOST_PARTS,
    NUMBER,
    ROTATION,
    ZERO,
    Extent,
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
    sub,
    vector,
)
from kfgen.spec.shaping.rotations import product, unit
from kfgen.spec.tree import Call, Tree

Share = Callable[[Shaped], Shaped]
"""Gives what is long a name, where it will be used several times."""


def elementwise(op: str, a: Shaped, b: Shaped) -> Shaped:
    """a + b, a - b."""
    if a.extent != b.extent and {a.extent, b.extent} != {ROTATION, vector(4)}:
        sign = {"add": "+", "sub": "-"}[op]
        hint = "write both with the same shape"
        if NUMBER in (a.extent, b.extent):
            hint = "a number has to be written out: `[1, 1, 1]`, or multiplied with a vector"
        raise ShapeError(f"`{sign}` joins {a.extent} and {b.extent}", hint)
    if a.extent == NUMBER:
        return number(Call(op, (a.number, b.number)))
    make = add if op == "add" else sub
    extent = vector(4) if a.extent == ROTATION else a.extent
    return Shaped(extent, tuple(make(x, y) for x, y in zip(a.parts, b.parts, strict=True)))


def negated(a: Shaped) -> Shaped:
    if a.extent == NUMBER:
        return number(Call("neg", a.parts))
    return Shaped(a.extent, tuple(map(neg, a.parts)))


def times(a: Shaped, b: Shaped, share: Share) -> Shaped:
    """a * b: a number and anything, or two quaternions."""
    if a.extent == NUMBER and b.extent == NUMBER:
        return number(Call("mul", (a.number, b.number)))
    if ROTATION in (a.extent, b.extent) and a.extent.size == b.extent.size == 4:
        return product(share(a), share(b))
    if a.extent == NUMBER:
        s = share(a).number
        return Shaped(_plain(b.extent), tuple(mul(s, x) for x in b.parts))
    if b.extent == NUMBER:
        s = share(b).number
        return Shaped(_plain(a.extent), tuple(mul(x, s) for x in a.parts))
    hint = "write `dot(a, b)`, `cross(a, b)` or `outer(a, b)`"
    if "matrix" in (a.extent.kind, b.extent.kind):
        hint = "write `A @ v`, `A @ B`"
    elif ROTATION in (a.extent, b.extent):
        hint = "write `rotate(q, v)`"
    raise ShapeError(f"`*` joins {a.extent} and {b.extent}", hint)


def divided(a: Shaped, b: Shaped, share: Share) -> Shaped:
    if b.extent != NUMBER:
        raise ShapeError(f"`/` divides {a.extent} by {b.extent}", "divide by a number")
    if a.extent == NUMBER:
        return number(Call("div", (a.number, b.number)))
    s = share(b).number
    return Shaped(_plain(a.extent), tuple(x if is_zero(x) else Call("div", (x, s)) for x in a.parts))


def _plain(extent: Extent) -> Extent:
    """A multiple of a quaternion is no rotation."""
    return vector(4) if extent == ROTATION else extent


def matmul(a: Shaped, b: Shaped, share: Share) -> Shaped:
    """A @ v, A @ B."""
    if a.extent.kind != "matrix" or b.extent.kind not in ("matrix", "vector"):
        hint = "write `dot(a, b)`" if a.extent.kind == "vector" == b.extent.kind else "write `A @ v`, `A @ B`"
        if a.extent.kind == "vector" and b.extent.kind == "matrix":
            hint = "write `transpose(A) @ v`"
        elif NUMBER in (a.extent, b.extent):
            hint = "write `*` for a factor"
        raise ShapeError(f"`@` joins {a.extent} and {b.extent}", hint)
    if a.extent.columns != b.extent.rows:
        text = f"`@` joins {a.extent} and {b.extent}: {a.extent.columns} columns, {b.extent.rows} rows"
        raise ShapeError(text, "write as many rows as columns")
    b = share(b)
    if b.extent.kind == "matrix":
        a = share(a)
    columns = range(b.extent.columns)
    parts = tuple(inner(a.row(i), b.column(j)) for i in range(a.extent.rows) for j in columns)
    extent = vector(a.extent.rows) if b.extent.kind == "vector" else matrix(a.extent.rows, b.extent.columns)
    return Shaped(extent, parts)


def listed(items: Sequence[Shaped]) -> Shaped:
    """[a, b, c] of numbers is a vector, of vectors a matrix of these rows."""
    first = items[0].extent
    if len(items) > MOST_PARTS:
        raise ShapeError(f"a list of {len(items)} is longer than {MOST_PARTS}", "use fewer")
    for i, item in enumerate(items):
        if item.extent.kind == "matrix":
            raise ShapeError(f"entry {i + 1} of the list is {item.extent}", "a list holds numbers, or rows")
        if (item.extent == NUMBER) != (first == NUMBER):
            text = f"the list mixes {first} (entry 1) and {item.extent} (entry {i + 1})"
            raise ShapeError(text, "write numbers only, or rows only")
        if item.extent.size != first.size:
            text = f"row {i + 1} of the matrix has {item.extent.size} entries, row 1 has {first.size}"
            raise ShapeError(text, "write rows of equal length")
    parts = tuple(part for item in items for part in item.parts)
    return column(parts) if first == NUMBER else Shaped(matrix(len(items), first.size), parts)


def partwise(op: str, arguments: Sequence[Shaped], whole: Sequence[Shaped], share: Share) -> Shaped:
    """A function of numbers, part by part; a number among vectors stands for all, and so does each of `whole`.

    whole: arguments before these that all parts have in common.
    """
    extents = [a.extent for a in arguments if a.extent != NUMBER]
    if not extents:
        return number(Call(op, tuple(a.number for a in (*whole, *arguments))))
    for other in extents[1:]:
        if other != extents[0]:
            raise ShapeError(f"`{op}` joins {extents[0]} and {other}", "write both with the same shape")
    common = tuple(share(a).number for a in whole)
    spread = [share(a).parts * extents[0].size if a.extent == NUMBER else a.parts for a in arguments]
    parts = tuple(Call(op, (*common, *each)) for each in zip(*spread, strict=True))
    return Shaped(extents[0], parts)


# --- functions


def wanted(name: str, value: Shaped, what: str, hint: str, *kinds: str) -> None:
    if value.extent.kind not in kinds:
        raise ShapeError(f"`{name}` wants {what}, not {value.extent}", hint)


def _vectors(name: str, a: Shaped, b: Shaped, size: int | None = None) -> None:
    for value in (a, b):
        wanted(name, value, f"a {size}-vector" if size else "a vector", f"write `{name}([1, 2, 3], v)`", "vector",
               "quaternion")  # fmt: skip
    if size is not None and not a.extent.rows == b.extent.rows == size:
        raise ShapeError(f"`{name}` wants {size}-vectors, not {a.extent} and {b.extent}", "write three numbers each")
    if a.extent.rows != b.extent.rows:
        raise ShapeError(f"`{name}` joins {a.extent} and {b.extent}", "write both with the same size")


def dot(a: Shaped, b: Shaped, share: Share) -> Shaped:
    _vectors("dot", a, b)
    return number(inner(a.parts, b.parts))


def cross(a: Shaped, b: Shaped, share: Share) -> Shaped:
    _vectors("cross", a, b, 3)
    return column(crossed(share(a).parts, share(b).parts))


def crossed(a: Sequence[Tree], b: Sequence[Tree]) -> tuple[Tree, ...]:
    return tuple(sub(mul(a[i], b[j]), mul(a[j], b[i])) for i, j in ((1, 2), (2, 0), (0, 1)))


def norm(a: Shaped, share: Share) -> Shaped:
    wanted("norm", a, "a vector", "write `abs(a)` of a number", "vector", "quaternion")
    return number(length(a.parts))


def normalize(a: Shaped, share: Share) -> Shaped:
    """a / |a|; 0 where |a| is 0."""
    wanted("normalize", a, "a vector", "write `sign(a)` of a number", "vector", "quaternion")
    return Shaped(a.extent, unit(share(a).parts, share))



def skew(a: Shaped, share: Share) -> Shaped:
    wanted("skew", a, "a 3-vector", "write `skew(v)`", "vector")
    if a.extent.rows != 3:
        raise ShapeError(f"`skew` wants a 3-vector, not {a.extent}", "write three numbers")
    x, y, z = share(a).parts
    return Shaped(matrix(3, 3), (ZERO, neg(z), y, z, ZERO, neg(x), neg(y), x, ZERO))


def transpose(a: Shaped, share: Share) -> Shaped:
    wanted("transpose", a, "a matrix", "a vector is transposed by none", "matrix")
    rows, columns = a.extent.rows, a.extent.columns
    return Shaped(matrix(columns, rows), tuple(p for j in range(columns) for p in a.column(j)))


def diag(a: Shaped, share: Share) -> Shaped:
    """Of a vector the diagonal matrix, of a square matrix its diagonal."""
    wanted("diag", a, "a vector or a matrix", "write `diag([1, 2, 3])`", "vector", "matrix")
    n = a.extent.rows
    if a.extent.kind == "matrix":
        if a.extent.columns != n:
            raise ShapeError(f"`diag` wants a square matrix, not {a.extent}", "write as many rows as columns")
        return column([a.parts[i * n + i] for i in range(n)])
    return Shaped(matrix(n, n), tuple(a.parts[i] if i == j else ZERO for i in range(n) for j in range(n)))


def outer(a: Shaped, b: Shaped, share: Share) -> Shaped:
    """a b^T."""
    for value in (a, b):
        wanted("outer", value, "vectors", "write `outer(a, b)`", "vector")
    a, b = share(a), share(b)
    return Shaped(matrix(a.extent.rows, b.extent.rows), tuple(mul(x, y) for x in a.parts for y in b.parts))
