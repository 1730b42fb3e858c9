"""What a section of the report is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Note:
    """A paragraph. tone: plain, good, bad."""

    text: str
    tone: str = "plain"
    kind: str = "note"


@dataclass(frozen=True)
class Grid:
    """A table. head: of its columns. right: columns of figures. bars: (row, column) -> share, drawn behind a cell."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Sequence[int] = ()
    bars: Mapping[tuple[int, int], float] = field(default_factory=dict)
    kind: str = "grid"


@dataclass(frozen=True)
class Pattern:
    """A matrix of which only the places that are not zero are told."""

    caption: str
    rows: Sequence[str]
    columns: Sequence[str]
    filled: Sequence[Sequence[bool]]
    kind: str = "pattern"


@dataclass(frozen=True)
class Picture:
    """A drawing. svg: what stands between the tags, title and description included."""

    svg: str
    caption: str
    kind: str = "picture"


@dataclass(frozen=True)
class Equations:
    """Formulas in MathML, a row each; plain: the same as text, for what reads no MathML."""

    caption: str
    rows: Sequence[str]
    kind: str = "equations"


@dataclass(frozen=True)
class Text:
    """Lines as they are."""

    caption: str
    lines: Sequence[str]
    kind: str = "text"


Block = Note | Grid | Pattern | Picture | Equations | Text


@dataclass(frozen=True)
class Section:
    """A section. data: its figures, merged into those of the report."""

    title: str
    blocks: Sequence[Block]
    data: Mapping[str, Any] = field(default_factory=dict)


def figure(number: float | None, digits: int = 4) -> str:
    """A number for a table; a dash for none."""
    if number is None or number != number:
        return "–"
    return f"{number:.{digits}g}"


def percent(share: float) -> str:
    return f"{100 * share:.1f} %"
