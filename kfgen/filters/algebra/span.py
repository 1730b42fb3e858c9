"""What traced values are bounded by where what they are made of is within declared limits."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from kfgen.ir.nodes import Node

Span = tuple[Fraction, Fraction]
Limits = Mapping[tuple[str, int | None], Span]
"""Path of a field, with the index of an element -> its declared limits."""


def span(node: Node, limits: Limits, known: dict[Node, Span | None] | None = None) -> Span | None:
    """The limits of a sum of products; None where something is not declared, or is another operation.

    known: those of nodes that were met before: a node stands in many others.
    """
    known = {} if known is None else known
    if node not in known:
        known[node] = _span(node, limits, known)
    return known[node]


def _span(node: Node, limits: Limits, met: dict[Node, Span | None]) -> Span | None:
    if node.constant is not None:
        return node.constant, node.constant
    if node.op == "field":
        return limits.get((str(node.data), None))
    if node.op == "element":
        index = node.args[0].constant
        return None if index is None else limits.get((str(node.data), int(index)))
    inner = [span(a, limits, met) for a in node.args]
    known = [s for s in inner if s is not None]
    if len(known) < len(inner) or not known:
        return None
    a, b = known[0], known[-1]
    match node.op:
        case "neg":
            return -a[1], -a[0]
        case "add":
            return a[0] + b[0], a[1] + b[1]
        case "sub":
            return a[0] - b[1], a[1] - b[0]
        case "mul":
            products = [x * y for x in a for y in b]
            return min(products), max(products)
        case "select":
            return min(s[0] for s in known[-2:]), max(s[1] for s in known[-2:])
    return None
