"""The places of a program that hold numbers, and which of them share a format.

A cell is a field, an element of an array, an argument or a local; its key is a tuple. Elements of an array that
loops go through share a cell with those a stride apart: the elements of one state over all sigma points.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import gcd

from kfgen.fixed.program.nodes import nodes_of
from kfgen.ir.nodes import Node
from kfgen.ir.program import Assign, Call, Declare, Function, Slice, Store, walk

Cell = tuple[object, ...]


@dataclass
class Arrays:
    """How the indices of every array fall into classes: array -> stride (0: every element for itself)."""

    strides: dict[Cell, int] = field(default_factory=dict)
    parents: dict[Cell, Cell] = field(default_factory=dict)

    def find(self, cell: Cell) -> Cell:
        while cell in self.parents:
            cell = self.parents[cell]
        return cell

    def tie(self, a: Cell, b: Cell) -> None:
        """Both are to have one format."""
        a, b = self.find(a), self.find(b)
        if a != b:
            self.parents[max(a, b, key=repr)] = min(a, b, key=repr)

    def element(self, array: Cell, index: int) -> Cell:
        stride = self.strides.get(array, 0)
        return self.find((*array, index % stride if stride else index))

    def named(self, function: Function, name: str, index: Node) -> Cell:
        """An element as a function names it; of an index that is not known, one of those it may be."""
        return self.element(array_of(function, name), affine(index)[0])

    def state(self, i: int) -> Cell:
        """State i of the filter."""
        return self.element(("array", "kf.x"), i)

    def variance(self, i: int, n: int) -> Cell:
        """P_ii of n states, as the user reads it."""
        return self.element(("array", "get_covariance", "P"), i * n + i)


def packed(i: int, j: int) -> int:
    """The place of P_ij, i <= j, among the columns of an upper triangle."""
    return j * (j + 1) // 2 + i


def array_of(function: Function, name: str) -> Cell:
    """The key of an array as a function names it: one of the struct, an argument, or a local."""
    return ("array", name) if name.startswith("kf.") else ("array", function.name, name)


def plain(path: str) -> str:
    """A field of a mode's filter as a filter by itself has it: kf.modes.turn.P is a kf.P."""
    return "kf." + path.split(".", 3)[3] if path.startswith("kf.modes.") else path


def number_of(function: Function, path: str) -> Cell:
    """The key of a number that a function is given."""
    if path.startswith(("kf.", "u.")) or path == "dt":
        return ("number", path)
    if function.private and path.startswith("z."):  # of the measurement of an update that calls it
        (sensor,) = [a.type.removeprefix("{name}_").removesuffix("_t") for a in function.arguments if a.name == "z"]
        return ("number", f"update_{sensor}", path)
    return ("number", function.name.removesuffix("_masked"), path)


def affine(index: Node) -> tuple[int, int]:
    """(constant part, gcd of what multiplies counters); a gcd of 1 stands for any index."""
    match index.op:
        case "const":
            return int(index.data), 0
        case "counter":
            return 0, 1
        case "add" | "sub":
            (a, g), (b, h) = affine(index.args[0]), affine(index.args[1])
            return (a + b if index.op == "add" else a - b), gcd(g, h)
        case "mul":
            (a, g), (b, h) = affine(index.args[0]), affine(index.args[1])
            if g and h:
                return a * b, gcd(g, h, g * h)
            return a * b, g * abs(b) + h * abs(a)
        case _:
            return 0, 1


def is_variance(path: str, index: Node) -> bool:
    """Whether an element of the struct is a variance: what is stored there is never below zero."""
    if plain(path) == "kf.D":
        return True
    if plain(path) != "kf.P" or index.constant is None:
        return False
    place, j = int(index.constant), 0
    while packed(j, j) < place:
        j += 1
    return packed(j, j) == place


def find_arrays(functions: list[Function]) -> Arrays:
    """The strides of all arrays of a program, after its private functions are tied to their callers."""
    arrays = Arrays()
    strides = arrays.strides

    def narrow(array: Cell, g: int) -> bool:
        new = gcd(strides.get(array, 0), g)
        changed = strides.get(array) != new
        strides[array] = new
        return changed

    for f in functions:
        for node in nodes_of(f.body):
            if node.kind == "real" and node.args and node.op in ("element", "read"):
                narrow(array_of(f, node.data), affine(node.args[0])[1])
        for s in walk(f.body):
            if isinstance(s, Assign | Store) and s.index is not None:
                narrow(array_of(f, s.name), affine(s.index)[1])
            elif isinstance(s, Declare) and s.size is not None:
                strides.setdefault(array_of(f, s.name), 0)
    joined = [
        (array_of(f, given.array), given.offset, array_of(s.callee, argument.name), argument.size or 0)
        for f in functions for s in walk(f.body) if isinstance(s, Call)
        for argument, given in zip(s.callee.arguments, s.args, strict=True) if isinstance(given, Slice)
    ]  # fmt: skip
    changed = True
    while changed:
        changed = False
        for outer, offset, inner, _ in joined:
            _, g = affine(offset)
            changed |= narrow(outer, gcd(g, strides.get(inner, 0)))
            changed |= narrow(inner, 0)
    for outer, offset, inner, size in joined:
        start, _ = affine(offset)
        for i in range(size):
            arrays.tie(arrays.element(outer, start + i), arrays.element(inner, i))
    return arrays
