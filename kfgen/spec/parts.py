"""The formulas of a part of a spec, whatever it is made of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass

from kfgen.spec.tree import Call, Expression


def expressions(part: object) -> Iterator[Expression]:
    """Every formula in a part of a spec."""
    if isinstance(part, Expression):
        yield part
    elif isinstance(part, Mapping):
        for each in part.values():
            yield from expressions(each)
    elif isinstance(part, tuple):
        for each in part:
            yield from expressions(each)
    elif is_dataclass(part):
        for field in fields(part):
            yield from expressions(getattr(part, field.name))


def nodes(part: object) -> int:
    """How many nodes the formulas of a part have: about its operations."""
    stack, count = [each.tree for each in expressions(part)], 0
    while stack:
        tree = stack.pop()
        count += 1
        stack += tree.args if isinstance(tree, Call) else ()
    return count
