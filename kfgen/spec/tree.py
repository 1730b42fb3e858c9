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

    op is one of OPERATORS or FUNCTIONS. `table` has the arguments (x, x1, x2, ..., y1, y2, ...).
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
