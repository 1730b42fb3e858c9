"""What an entry of a covariance or of its factors is called in the emitted C: `p_px_vx`, and `p_px_vx_next`."""

from __future__ import annotations

from collections.abc import Sequence

LONGEST = 60
"""Letters of a name. Beyond it states are told by their places: `p_3_7`, so that a declaration fits a line."""


def entry(letter: str, names: Sequence[str], *places: int) -> str:
    """An entry at these inner places, of states of these names (in the inner order)."""
    name = "_".join([letter, *(names[i] for i in places)])
    return name if len(name) <= LONGEST else "_".join([letter, *map(str, places)])


def entry_next(letter: str, names: Sequence[str], *places: int) -> str:
    """The new value of an entry."""
    return entry(letter, names, *places) + "_next"


def entries(letter: str, names: Sequence[str], diagonal: bool = True) -> tuple[str, ...]:
    """The entries of an upper triangle, column by column."""
    return tuple(entry(letter, names, i, j) for j in range(len(names)) for i in range(j + diagonal))
