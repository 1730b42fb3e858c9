"""Which of the numbers that a caller sets a function reads."""

from __future__ import annotations

from collections.abc import Iterable

from kfgen.ir.nodes import Node
from kfgen.ir.program import Call, Statement, roots, walk

GIVEN = ("u.", "z.", "kf.parameters.")
"""Paths of inputs, of what comes with a measurement, and of parameters."""


def given(statements: Iterable[Statement]) -> set[str]:
    """Paths of what a caller sets that statements use, in private functions too."""
    found: set[str] = set()
    seen: set[int] = set()
    for statement in statements:
        if isinstance(statement, Call):
            found |= given(walk(statement.callee.body))
        stack: list[Node] = roots(statement)
        while stack:
            node = stack.pop()
            if node.op != "const" and id(node) not in seen:
                seen.add(id(node))
                if node.op == "field" and str(node.data).startswith(GIVEN):
                    found.add(node.data)
                stack += node.args
    return found
