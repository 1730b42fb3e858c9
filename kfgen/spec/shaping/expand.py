"""A formula as it is written -> the trees of its parts: vectors typed and written out, nothing else changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from kfgen.spec.expressions import MAX_DEPTH, Source, balanced, depth
from kfgen.spec.lexer import ExpressionError
from kfgen.spec.problems import short
from kfgen.spec.shaping import algebra, rotations
from kfgen.spec.shaping.extents import NUMBER, ROTATION, Extent, Shaped, ShapeError, number, vector
from kfgen.spec.tree import FUNCTIONS, VECTOR_FUNCTIONS, Call, Name, Number, Tree

MAX_EXPANDED = 5_000  # nodes of one part
_SHORT = 12  # nodes of what may stand several times

_FUNCTIONS: dict[str, Callable[..., Shaped]] = {
    "dot": algebra.dot, "cross": algebra.cross, "norm": algebra.norm, "normalize": algebra.normalize,
    "skew": algebra.skew, "transpose": algebra.transpose, "diag": algebra.diag, "outer": algebra.outer,
    "conjugate": rotations.conjugate, "rotate": rotations.rotate, "unrotate": rotations.unrotate,
    "rotation": rotations.rotation, "rotation_vector": rotations.rotation_vector,
    "from_rotation_vector": rotations.from_rotation_vector, "roll": rotations.roll, "pitch": rotations.pitch,
    "yaw": rotations.yaw, "from_euler": rotations.from_euler, "rotation_between": rotations.rotation_between,
    "triad": rotations.triad,
}  # fmt: skip
_PARTWISE = ("min", "max", "abs", "where", "table")


class Unknown(Exception):  # noqa: N818 - what is said of it elsewhere
    """A name whose shape is not known: it is undeclared, or its own mistake has been reported."""


class Names(Protocol):
    """What names stand for, and where the names of hidden definitions come from."""

    def value(self, name: str) -> Shaped:
        """The parts of a name; Unknown where there is none."""

    def define(self, tree: Tree) -> Tree | None:
        """A name for a tree that is used several times; None where none may be given."""


class Expander:
    """Expands one formula."""

    def __init__(self, names: Names, source: Source) -> None:
        self.names, self.source = names, source

    def whole(self) -> Shaped:
        """ExpressionError where shapes do not fit, or parts become too long; Unknown."""
        found = self.expand(self.source.tree)
        if any(depth(part) > MAX_DEPTH for part in set(found.parts)):
            raise ExpressionError(0, "the expression is nested too deeply when it is written out", _SPLIT)
        return found

    def expand(self, tree: Tree) -> Shaped:
        if isinstance(tree, Number):
            return number(tree)
        if isinstance(tree, Name):
            return self.names.value(tree.name)
        args = [self.expand(argument) for argument in tree.args] if tree.op != "index" else []
        if (tree.op in FUNCTIONS or tree.op in _SCALAR) and all(a.extent == NUMBER for a in args):
            made = tuple(a.number for a in args)
            same = all(a is b for a, b in zip(made, tree.args, strict=True))
            return number(tree if same else Call(tree.op, made))
        try:
            found = self.operation(tree, args)
        except ShapeError as error:
            raise ExpressionError(self.offset(tree), error.message, error.hint) from None
        if any(count(part, MAX_EXPANDED) > MAX_EXPANDED for part in found.parts):
            text = f"written out, a part of this has more than {MAX_EXPANDED} nodes"
            raise ExpressionError(self.offset(tree), text, _SPLIT)
        return found

    def offset(self, tree: Tree) -> int:
        return self.source.offsets.get(id(tree), 0)

    def operation(self, tree: Call, args: list[Shaped]) -> Shaped:
        op = tree.op
        if op.startswith("chain "):
            return self.chain(op.split()[1:], args)
        if op.startswith("part."):
            return part(args[0], op.removeprefix("part."), written(tree.args[0]))
        if op == "index":
            return indexed(self.expand(tree.args[0]), [int(i.value) for i in tree.args[1:] if isinstance(i, Number)])
        if op == "list":
            return algebra.listed(args)
        if op in VECTOR_FUNCTIONS:
            return _FUNCTIONS[op](*args, self.share)
        if op in _PARTWISE:
            return self.partwise(op, args)
        if op == "neg":
            return algebra.negated(args[0])
        if op in ("add", "sub", "mul", "div", "matmul"):
            return self.binary(op, args[0], args[1])
        wrong = next(a for a in args if a.extent != NUMBER)
        hint = "write `dot(a, a)` for a square" if op == "pow" else "write one part of it: `v.x`"
        if wrong.extent == ROTATION:
            hint = "write one part of it, `q.w`; or an angle, `yaw(q)`"
        raise ShapeError(f"`{_SIGNS.get(op, op)}` wants numbers, not {wrong.extent}", hint)

    def binary(self, op: str, a: Shaped, b: Shaped) -> Shaped:
        if op in ("add", "sub"):
            return algebra.elementwise(op, a, b)
        made = {"mul": algebra.times, "div": algebra.divided, "matmul": algebra.matmul}[op]
        return made(a, b, self.share)

    def chain(self, ops: list[str], args: list[Shaped]) -> Shaped:
        """A long sum or product: of numbers a balanced tree, else from the left."""
        if all(a.extent == NUMBER for a in args) and "matmul" not in ops:
            return number(balanced(list(zip(["", *ops], [a.number for a in args], strict=True))))
        if ops[0] in ("add", "sub"):
            for a in args[1:]:
                algebra.elementwise("add", args[0], a)  # shapes
            columns = zip(*(a.parts for a in args), strict=True)
            return Shaped(args[0].extent, tuple(balanced(list(zip(["", *ops], c, strict=True))) for c in columns))
        found = args[0]
        for op, a in zip(ops, args[1:], strict=True):
            found = self.binary(op, found, a)
        return found

    def partwise(self, op: str, args: list[Shaped]) -> Shaped:
        if op == "where":
            return algebra.partwise(op, args[1:], args[:1], self.share)
        if op == "table":
            half = 1 + len(args) // 2
            for x in args[1:half]:
                if x.extent != NUMBER:
                    raise ShapeError(f"`table` wants numbers in its first list, not {x.extent}", "write numbers")
        return algebra.partwise(op, args, [], self.share)

    def share(self, value: Shaped) -> Shaped:
        """With names for parts that are long, since they are about to stand several times."""
        parts = tuple(p if count(p, _SHORT) <= _SHORT else self.names.define(p) or p for p in value.parts)
        return Shaped(value.extent, parts, value.suffixes)


_SPLIT = "split it with `let`"
_SCALAR = frozenset(("add", "sub", "mul", "div", "pow", "neg", "lt", "le", "gt", "ge", "and", "or", "not"))
_SIGNS = {"pow": "**", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}


def count(tree: Tree, limit: int) -> int:
    """The nodes of a tree, counted until they exceed a limit."""
    found, stack = 0, [tree]
    while stack and found <= limit:
        found += 1
        node = stack.pop()
        if isinstance(node, Call):
            stack += node.args
    return found


def written(tree: Tree) -> str:
    return tree.name if isinstance(tree, Name) else ""


def part(value: Shaped, suffix: str, name: str = "") -> Shaped:
    """v.x, q.w."""
    what = f"{short(name)} is" if name else "this is"
    if value.extent.kind not in ("vector", "quaternion"):
        hint = "write it alone" if value.extent == NUMBER else "write `M[0, 1]`"
        raise ShapeError(f"{what} {value.extent}, and has no part {short(suffix)}", hint)
    if suffix not in value.names:
        known = ", ".join(f"`{name}.{s}`" if name else f"`{s}`" for s in value.names[:10])
        raise ShapeError(f"{what} {value.extent} without a part {short(suffix)}", f"its parts: {known}")
    return number(value.parts[value.names.index(suffix)])


def indexed(value: Shaped, indices: list[int]) -> Shaped:
    """v[0], M[0, 1]; M[0] is a row."""
    extent = value.extent
    if extent == NUMBER:
        raise ShapeError("a number has no index", "write it alone")
    sizes = [extent.rows, extent.columns] if extent.kind == "matrix" else [extent.rows]
    if len(indices) > len(sizes):
        raise ShapeError(f"two indices of {extent}", "write `v[0]`")
    for index, size in zip(indices, sizes, strict=False):
        if index >= size:
            raise ShapeError(f"the index {index} is beyond {extent}", f"indices go from 0 to {size - 1}")
    if extent.kind != "matrix":
        return number(value.parts[indices[0]])
    row = value.row(indices[0])
    return number(row[indices[1]]) if len(indices) == 2 else Shaped(vector(len(row)), row)


def fitted(value: Shaped, extent: Extent, spread: bool = True) -> Shaped | None:
    """The value where a shape is wanted: a number stands for all, four numbers for a quaternion; else None."""
    if value.extent == extent:
        return value
    if spread and value.extent == NUMBER:
        return Shaped(extent, value.parts * extent.size)
    if {value.extent, extent} == {ROTATION, vector(4)}:
        return Shaped(extent, value.parts)
    return None
