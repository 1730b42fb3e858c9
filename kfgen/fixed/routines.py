"""Which C routine needs which: the emitted file holds those that its code calls, and what these call."""

from __future__ import annotations

from collections.abc import Iterable

NEEDS: dict[str, tuple[str, ...]] = {
    "sar": (),
    "sar32": (),
    "limit": (),
    "round": ("sar",),
    "clamp": ("limit",),
    "narrow": ("round", "clamp"),
    "product": ("sar32",),
    "mul": ("product", "narrow"),
    "madd": ("product", "round", "clamp"),
    "add": ("limit",),
    "sub": ("limit",),
    "shift": ("sar32", "limit"),
    "leading": (),
    "mulh": (),
    "signed": ("limit",),
    "inverse": ("mulh", "sar32"),
    "div": ("leading", "inverse", "mulh", "signed"),
    "reciprocal": ("leading", "inverse", "signed"),
    "root": ("mulh", "sar32"),
    "sqrt": ("leading", "root", "limit"),
}
"""Routine -> those that it calls itself. In the order of their definitions."""


def closure(ops: Iterable[str]) -> tuple[str, ...]:
    """The routines that code which calls `ops` needs, in the order of NEEDS. KeyError for one that does not exist."""
    needed: set[str] = set()
    waiting = list(ops)
    while waiting:
        op = waiting.pop()
        if op not in needed:
            needed.add(op)
            waiting += NEEDS[op]
    return tuple(op for op in NEEDS if op in needed)
