"""Progress of long work, on stderr where that is a terminal."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from kfgen.commands.tables import on_terminal

Advance = Callable[[int, str], None]
"""Called with how much is done, and what is being done now."""


@contextmanager
def progress(total: int, worth: bool = True) -> Iterator[Advance]:
    """A bar of `total` steps, gone when the work is done; nothing where it is not `worth` its flicker."""
    if not (worth and on_terminal(err=True)) or os.environ.get("TERM") == "dumb":
        yield lambda done, what: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, what: bar.update(task, completed=done, description=what)
