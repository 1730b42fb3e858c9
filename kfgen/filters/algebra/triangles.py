"""Where the entries of triangular and symmetric matrices stand in the arrays that hold them, column by column."""

from __future__ import annotations

from kfgen.ir.trace import Value


def strict(i: int, j: int) -> int:
    """Position of entry (i, j), i < j, of a strictly upper triangle."""
    return j * (j - 1) // 2 + i


def upper(i: int, j: int) -> int:
    """Position of entry (i, j), i <= j, of an upper triangle."""
    return j * (j + 1) // 2 + i


def strict_start(j: Value) -> Value:
    """j (j - 1) / 2: where column j of a strictly upper triangle starts, for a counter j."""
    t = j.trace
    return t.wrapped(t.pool.make("half", ((j * (j - 1)).node,), kind="int"))


def upper_start(j: Value) -> Value:
    """j (j + 1) / 2: where column j of an upper triangle starts, for a counter j."""
    t = j.trace
    return t.wrapped(t.pool.make("half", ((j * (j + 1)).node,), kind="int"))


def strict_size(n: int) -> int:
    """Entries above the diagonal."""
    return n * (n - 1) // 2


def upper_size(n: int) -> int:
    """Entries on and above the diagonal."""
    return n * (n + 1) // 2
