"""Words as a C file can hold them: escaped, filled, in columns."""

from __future__ import annotations

import re
from collections.abc import Sequence

WIDTH = 100
"""Columns of a line of C."""


def comment(text: str, depth: int = 0) -> list[str]:
    """A comment in lines of at most WIDTH columns."""
    words = text.split()
    indent = "    " * depth
    lines = [indent + "/*"]
    for word in words:
        if len(lines[-1]) + 1 + len(word) > WIDTH - 3:
            lines.append(indent + "  ")
        lines[-1] += " " + word
    lines[-1] += " */"
    return lines


def safe(text: str) -> str:
    """Free text of the spec, unable to end a comment or to start a trigraph."""
    return re.sub(r"\?(?=\?)", "? ", text.replace("*/", "* /").replace("/*", "/ *"))


def about(unit: str, doc: str) -> str:
    """What a number is: `[m/s] speed over ground`, either part where there is one."""
    unit, doc = safe(unit), safe(doc)
    return " ".join(part for part in (f"[{unit}]" if unit else "", " ".join(doc.split())) if part)


def with_unit(name: str, unit: str) -> str:
    """`speed [m/s]`."""
    unit = safe(unit)
    return f"{name} [{unit}]" if unit else name


def fill(text: str, width: int) -> list[str]:
    """The words in lines of at most so many columns; at least one line."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of as many cells each, in columns as wide as they need; a column of empty cells takes no room."""
    if not rows:
        return []
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True) if w).rstrip() for row in rows]
