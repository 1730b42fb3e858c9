"""Shapes of values in formulas: numbers, vectors, matrices, quaternions; and vectors of trees, part by part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from kfgen.spec.expressions import balanced
from kfgen.spec.tree import Call, Number, Tree

MOST_PARTS = 100  # of a vector
LETTERS = {2: ("x", "y"), 3: ("x", "y", "z")}
QUATERNION = ("w", "x", "y", "z")


class ShapeError(Exception):
    """What is wrong with the shapes of an operation, and what to write instead."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


@dataclass(frozen=True, slots=True)
class Extent:
    """The shape of a value. kind: number | vector (rows) | matrix (rows x columns) | quaternion (4 rows)."""

    kind: str
    rows: int = 1
    columns: int = 1

    @property
    def size(self) -> int:
        return self.rows * self.columns

    def __str__(self) -> str:
        if self.kind == "vector":
            return f"a {self.rows}-vector"
        if self.kind == "matrix":
            return f"a {self.rows} x {self.columns} matrix"
        return f"a {self.kind}"


NUMBER = Extent("number")
ROTATION = Extent("quaternion", 4)


def vector(size: int) -> Extent:
    return Extent("vector", size)


def matrix(rows: int, columns: int) -> Extent:
    return Extent("matrix", rows, columns)


def suffixes(extent: Extent) -> tuple[str, ...]:
    """The names of the parts of a value that has none of its own, in order."""
    if extent.kind == "quaternion":
        return QUATERNION
    if extent.kind == "matrix":
        return tuple(f"{i + 1}_{j + 1}" for i in range(extent.rows) for j in range(extent.columns))
    return LETTERS.get(extent.rows) or tuple(str(i + 1) for i in range(extent.rows))


@dataclass(frozen=True, slots=True)
class Shaped:
    """A value in a formula: its parts as trees, those of a matrix by rows. suffixes: the parts' names."""

    extent: Extent
    parts: tuple[Tree, ...]
    suffixes: tuple[str, ...] = ()

    @property
    def number(self) -> Tree:
        return self.parts[0]

    @property
    def names(self) -> tuple[str, ...]:
        return self.suffixes or suffixes(self.extent)

    def row(self, i: int) -> tuple[Tree, ...]:
        return self.parts[i * self.extent.columns : (i + 1) * self.extent.columns]

    def column(self, j: int) -> tuple[Tree, ...]:
        return self.parts[j :: self.extent.columns]


ZERO, ONE, TWO = (Number(Fraction(i)) for i in range(3))


def number(tree: Tree) -> Shaped:
    return Shaped(NUMBER, (tree,))


def column(parts: Sequence[Tree]) -> Shaped:
    return Shaped(vector(len(parts)), tuple(parts))


def is_zero(tree: Tree) -> bool:
    return isinstance(tree, Number) and tree.value == 0


def is_one(tree: Tree) -> bool:
    return isinstance(tree, Number) and tree.value == 1


def add(a: Tree, b: Tree) -> Tree:
    return b if is_zero(a) else a if is_zero(b) else Call("add", (a, b))


def sub(a: Tree, b: Tree) -> Tree:
    return a if is_zero(b) else neg(b) if is_zero(a) else Call("sub", (a, b))


def neg(a: Tree) -> Tree:
    return a if is_zero(a) else Call("neg", (a,))


def mul(a: Tree, b: Tree) -> Tree:
    if is_zero(a) or is_zero(b):
        return ZERO
    return b if is_one(a) else a if is_one(b) else Call("mul", (a, b))


def square(a: Tree) -> Tree:
    return ZERO if is_zero(a) else Call("pow", (a, TWO))


def total(terms: Sequence[Tree]) -> Tree:
    """The sum of terms, from the left; of many a balanced tree."""
    left = [term for term in terms if not is_zero(term)]
    if not left:
        return ZERO
    if len(left) > 1:
        return balanced([("", left[0]), *(("add", term) for term in left[1:])])
    return left[0]


def inner(a: Sequence[Tree], b: Sequence[Tree]) -> Tree:
    return total([mul(x, y) for x, y in zip(a, b, strict=True)])


def length(parts: Sequence[Tree]) -> Tree:
    """The root of the sum of squares."""
    squares = total([square(part) for part in parts])
    return ZERO if is_zero(squares) else Call("sqrt", (squares,))
