"""Tables of rich in which a cell folds between its phrases, never within one."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from rich.box import Box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

_RULE = Box("    \n    \n -  \n    \n    \n    \n    \n    \n", ascii=True)
_GLUE = "\u00a0"


class Phrases:
    """`94 mul, 62 add, 1 sin`: each piece up to a comma stays on one line."""

    def __init__(self, text: str) -> None:
        self.pieces = [piece.replace(" ", _GLUE) for piece in text.split(", ")]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        lines = textwrap.wrap(", ".join(self.pieces), options.max_width, break_on_hyphens=False)
        yield Text("\n".join(lines).replace(_GLUE, " "))

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        longest = max(len(piece) + 1 for piece in self.pieces)
        return Measurement(longest, len(", ".join(self.pieces))).with_maximum(options.max_width)


def ruled(rows: Sequence[Sequence[str]], right: Sequence[int]) -> Table:
    """A table of text, its first row above a rule; columns in `right` stand to the right."""
    table = Table(box=_RULE, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    for i, title in enumerate(rows[0]):
        table.add_column(Text(title), justify="right" if i in right else "left", overflow="fold")
    for row in rows[1:]:
        table.add_row(*(Phrases(cell) if ", " in cell else Text(cell) for cell in row))
    return table
