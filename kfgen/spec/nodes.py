"""The YAML node graph: scalars, mappings and sequences with their positions, before any meaning.

A plain scalar is resolved by the core schema of YAML 1.2, narrowed by the language: dates, non-finite,
underscored, hexadecimal and octal numbers are refused rather than taken for something else.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

NULL = re.compile(r"(?:~|null|Null|NULL)?\Z")
BOOLEAN = re.compile(r"(?:true|True|TRUE|false|False|FALSE)\Z")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\Z", re.ASCII)
_NON_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)\Z")
_DATE = re.compile(r"\d{4}-\d{1,2}-\d{1,2}(?:[Tt\s].*)?\Z", re.ASCII | re.DOTALL)
_UNDERSCORED = re.compile(r"[-+]?(?=.*\d_)[\d.][\d_.]*(?:[eE][-+]?[\d_]+)?\Z", re.ASCII)
_BASED = re.compile(r"[-+]?0(?:[xX][0-9a-fA-F_]+|[oO][0-7_]+|[bB][01_]+)\Z")


@dataclass(slots=True, eq=False)
class Scalar:
    line: int
    column: int
    text: str
    plain: bool
    # column of each character of `text`, where the scalar stands on one line; None elsewhere
    columns: tuple[int, ...] | None = None
    size: int = 1

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of a character of the text; of the scalar's start where it is not known."""
        if self.columns is None or not self.columns:
            return self.line, self.column
        return self.line, self.columns[min(offset, len(self.columns) - 1)]

    @property
    def kind(self) -> str:
        """null, boolean, number or text."""
        if not self.plain:
            return "text"
        if NULL.match(self.text):
            return "null"
        if BOOLEAN.match(self.text):
            return "boolean"
        return "number" if NUMBER.match(self.text) else "text"


@dataclass(slots=True, eq=False)
class Mapping:
    line: int
    column: int
    flow: bool
    items: list[tuple[Scalar, Node]] = field(default_factory=list)
    size: int = 1


@dataclass(slots=True, eq=False)
class Sequence:
    line: int
    column: int
    flow: bool
    items: list[Node] = field(default_factory=list)
    size: int = 1


@dataclass(slots=True, eq=False)
class Bad:
    """Something whose mistake has been reported already."""

    line: int
    column: int
    size: int = 1


Node = Scalar | Mapping | Sequence | Bad


def refused(text: str) -> tuple[str, str] | None:
    """What is wrong with a plain scalar that other YAML readers take for a number or a date, and the cure."""
    if _NON_FINITE.match(text):
        return f"`{text}` is not finite", "write a finite number"
    if _DATE.match(text):
        return f"`{text}` is a date to YAML", "quote it where it is text"
    if _UNDERSCORED.match(text):
        return f"the number `{text}` has underscores", f"write {text.replace('_', '')}"
    if _BASED.match(text):
        return f"`{text}` is not a decimal number", "write it in decimal"
    return None


def kind_of(node: Node) -> str:
    """A word for messages: what a node is."""
    if isinstance(node, Mapping):
        return "a mapping"
    if isinstance(node, Sequence):
        return "a list"
    if isinstance(node, Scalar):
        words = {"null": "nothing", "boolean": "a boolean", "number": "a number", "text": "text"}
        return words[node.kind]
    return "something else"


def columns_of(raw: str, value: str, style: str | None, column: int) -> tuple[int, ...] | None:
    """The column of each character of a scalar that stands on one line (None: not known)."""
    if "\n" in raw or "\r" in raw:
        return None
    if not style:
        return tuple(range(column, column + len(value) + 1)) if raw.startswith(value) else None
    if style == '"' and "\\" not in raw:
        return tuple(range(column + 1, column + len(value) + 2)) if raw[1:-1] == value else None
    if style != "'":
        return None
    columns: list[int] = []
    i = 1
    while i < len(raw) - 1:
        columns.append(column + i)
        i += 2 if raw[i : i + 2] == "''" else 1
    columns.append(column + i)
    return tuple(columns) if len(columns) == len(value) + 1 else None
