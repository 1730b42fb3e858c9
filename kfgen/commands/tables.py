"""What a person looks at: tables, notes and verdicts that fold to the terminal.

Where the output is no terminal, each row is one line, however long, and there is no colour; rich is not even
imported then, since that takes a noticeable part of a short command.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from rich.console import RenderableType


@dataclass(frozen=True)
class Table:
    """Rows of text, the first of them the header; columns in `right` stand to the right."""

    rows: Sequence[Sequence[str]]
    right: Sequence[int] = ()


@dataclass(frozen=True)
class Notes:
    """Remarks, each with whom it is about."""

    entries: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Paths:
    """Names of files, a line each, which no terminal breaks."""

    names: Sequence[str]


@dataclass(frozen=True)
class Verdict:
    """A line that says whether all is well."""

    text: str
    good: bool


Part = str | Table | Notes | Paths | Verdict


def show(*parts: Part, err: bool = False) -> None:
    """Print parts, one below the other, to stdout or stderr; nothing for a table or notes without entries."""
    if on_terminal(err):
        from rich.console import Console

        console = Console(stderr=err, highlight=False, emoji=False, markup=False)
        for part in parts:
            console.print(_rich(part), soft_wrap=isinstance(part, Paths))
        return
    for line in lines(*parts):
        click.echo(line, err=err)


def on_terminal(err: bool = False) -> bool:
    stream = sys.stderr if err else sys.stdout
    return stream is not None and stream.isatty()


def lines(*parts: Part) -> list[str]:
    """The parts as plain text."""
    return [line for part in parts for line in _plain(part)]


def _plain(part: Part) -> list[str]:
    if isinstance(part, Table):
        return aligned(part.rows, part.right)
    if isinstance(part, Notes):
        return [f"{who}: {what}" for who, what in part.entries]
    if isinstance(part, Paths):
        return list(part.names)
    return (part.text if isinstance(part, Verdict) else part).split("\n")


def aligned(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> list[str]:
    """Text rows as lines with aligned columns, the first row underlined; columns in `right` to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    rule = ["-" * width for width in widths]
    return [
        "  ".join(
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in [rows[0], rule, *rows[1:]]
    ]


def _rich(part: Part) -> RenderableType:
    """A part as rich prints it; imported here, as rich is."""
    from rich.table import Table as Grid
    from rich.text import Text

    from kfgen.commands.folding import ruled

    if isinstance(part, Table):
        return ruled(part.rows, part.right)
    if isinstance(part, Notes):
        grid = Grid.grid(padding=(0, 1, 0, 0))
        grid.add_column(style="bold", no_wrap=True)
        grid.add_column(overflow="fold")
        for who, what in part.entries:
            grid.add_row(Text(f"{who}:"), Text(what))
        return grid
    if isinstance(part, Paths):
        return Text("\n".join(part.names))
    if isinstance(part, Verdict):
        return Text(part.text, style="green" if part.good else "bold red")
    return Text(part)
