"""What lowering leaves behind: locals that nobody reads, headings of nothing."""

from __future__ import annotations

from dataclasses import replace

from kfgen.fixed.program.nodes import variables
from kfgen.ir.program import For, If, Let, Section, Statement, walk


def alive(body: list[Statement]) -> list[Statement]:
    """Without locals that nobody reads, as those of guards that have vanished."""
    while True:
        used = {name for s in walk(body) for name in variables(s)}
        kept, dropped = _without(body, used)
        if not dropped:
            return kept
        body = kept


def _without(body: list[Statement], used: set[str]) -> tuple[list[Statement], bool]:
    out: list[Statement] = []
    dropped = False
    for s in body:
        if isinstance(s, Let) and s.name not in used:
            dropped = True
            continue
        if isinstance(s, For | If):
            inner, gone = _without(s.body, used)
            dropped |= gone
            s = replace(s, body=inner)
        out.append(s)
    return out, dropped


def tidied(body: list[Statement]) -> list[Statement]:
    """Without headings of nothing."""
    kept: list[Statement] = []
    for s in body:
        if isinstance(s, Section) and kept and isinstance(kept[-1], Section):
            kept.pop()
        kept.append(s)
    if kept and isinstance(kept[-1], Section):
        kept.pop()
    return kept
