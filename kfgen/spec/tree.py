"""Expression trees: what the whitelist parser returns, and all that any later stage sees of a formula."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from kfgen.errors import Place


@dataclass(frozen=True, slots=True)
class Number:
    """An exact decimal literal."""

    value: Fraction


@dataclass(frozen=True, slots=True)
class Name:
    """A constant, parameter, state, input, noise, definition, `pi`, `e`, `dt`, `t` (and `z`, `h` in a residual)."""

    name: str


@dataclass(frozen=True, slots=True)
class Call:
    """An operator or a function applied to arguments.

    op is one of OPERATORS, FUNCTIONS or ROTATIONS. `table` has the arguments (x, x1, x2, ..., y1, y2, ...).
    """

    op: str
    args: tuple[Tree, ...]


Tree = Number | Name | Call

# arithmetic, comparisons, logic; `neg` and `not` are unary, all others binary
OPERATORS = ("add", "sub", "mul", "div", "pow", "neg", "lt", "le", "gt", "ge", "and", "or", "not")

# function name -> number of arguments (None: see Call)
FUNCTIONS: dict[str, int | None] = {
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2,
    "sinh": 1, "cosh": 1, "tanh": 1, "exp": 1, "log": 1, "sqrt": 1, "abs": 1, "sign": 1,
    "min": 2, "max": 2, "hypot": 2, "floor": 1, "where": 3, "table": None,
}  # fmt: skip

# functions of vectors, matrices and quaternions, which the reader expands: functions only before `(`, so that a name
# may be the same word; name -> number of arguments
VECTOR_FUNCTIONS: dict[str, int] = {
    "dot": 2, "cross": 2, "norm": 1, "normalize": 1, "skew": 1, "transpose": 1, "diag": 1, "outer": 2,
    "conjugate": 1, "rotate": 2, "unrotate": 2, "rotation": 1, "rotation_vector": 1, "from_rotation_vector": 1,
    "roll": 1, "pitch": 1, "yaw": 1, "from_euler": 3, "rotation_between": 2, "triad": 4,
}  # fmt: skip

# what the reader leaves of rotations: numbers, of which the first arguments are indices (Numbers).
# rotation(i, j, w, x, y, z): entry (i, j) of R(q), 0 to 2; rotation_vector(k, w, x, y, z): part k, 0 to 2, of the
# vector of a quaternion; from_rotation_vector(k, x, y, z): part k, 0 to 3, of the quaternion of a vector
ROTATIONS: dict[str, int] = {"rotation": 6, "rotation_vector": 5, "from_rotation_vector": 4}


def names(tree: Tree) -> Iterator[str]:
    """Every name in a tree, in reading order, repeats included."""
    if isinstance(tree, Name):
        yield tree.name
    elif isinstance(tree, Call):
        for argument in tree.args:
            yield from names(argument)


@dataclass(frozen=True, slots=True)
class Expression:
    """A formula of the spec: its tree, the text it was written as, and where it stands."""

    tree: Tree
    text: str
    place: Place
