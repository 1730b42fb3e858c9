"""What a test of numbers shows of those they are made of: NaN and infinity pass through most operations."""

from __future__ import annotations

from collections.abc import Iterable

from kfgen.ir.nodes import Node
from kfgen.ir.program import For, Guard, If
from kfgen.ir.recording import Block
from kfgen.ir.trace import Trace

# an argument that is not finite makes the result not finite: infinity times 0, or less infinity, is NaN
_PASSING = frozenset(
    {"add", "sub", "mul", "neg", "sqrt", "sin", "cos", "tan", "log", "abs", "asin", "acos", "sinh", "cosh", "hypot",
     "floor"}
)  # fmt: skip

# finite arguments make a finite result
_KEEPING = frozenset(
    {"neg", "sin", "cos", "abs", "atan", "atan2", "tanh", "floor", "wrap", "min", "max", "select", "sign"}
)


def shown(tested: Iterable[Node]) -> set[Node]:
    """Nodes that are finite where those tested are."""
    seen: set[Node] = set()
    stack = list(tested)
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        if node.op in _PASSING:
            stack += node.args
        elif node.op == "div":  # x / infinity is 0
            stack.append(node.args[0])
    return seen


def unwrapped(node: Node) -> Node:
    """What is finite where the node is: an angle before it is wrapped, by comparisons that a compiler may take to be
    of numbers."""
    while node.op == "wrap":
        (node,) = node.args
    return node


def is_sure(node: Node, known: set[Node]) -> bool:
    """Whether a number is finite because others are."""
    if node in known or node.constant is not None:
        return True
    return node.op in _KEEPING and all(is_sure(a, known) for a in node.args if a.kind == "real")


def shown_first(t: Trace) -> set[Node]:
    """Nodes whose tests come before any status but NOT_FINITE."""
    seen: set[Node] = set()
    for item in t.block.items:
        if isinstance(item, For | If) and _leaves(t, t.blocks[id(item)]):
            break
        if isinstance(item, Guard):
            if item.status != "NOT_FINITE":
                break
            test = item.condition
            if test.op == "not" and test.args[0].op == "finite":
                seen |= shown(test.args[0].args)
    return seen


def _leaves(t: Trace, block: Block) -> bool:
    """Whether a function may end within a block."""
    inner = [t.blocks[id(item)] for item in block.items if isinstance(item, For | If)]
    return any(isinstance(item, Guard) for item in block.items) or any(_leaves(t, each) for each in inner)
