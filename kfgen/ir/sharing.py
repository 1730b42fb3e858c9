"""Which values of a recording become locals: those used more than once, and those that the algorithm named."""

from __future__ import annotations

from collections import Counter

from kfgen.ir.nodes import Node
from kfgen.ir.program import For, If, roots
from kfgen.ir.recording import Block
from kfgen.ir.trace import Trace


class Sharing:
    """uses: places that evaluate a node. kept: nodes that become locals for another reason, as it is found."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.uses: Counter[Node] = Counter()
        self.kept: set[Node] = set()
        self._count(trace.block)

    def _count(self, block: Block) -> None:
        seen: set[Node] = set()
        stack: list[Node] = []

        def collect(inner: Block) -> None:
            for item in inner.items:
                if isinstance(item, Node):
                    continue
                stack.extend(roots(item))
                if isinstance(item, For | If):
                    collect(self.trace.blocks[id(item)])

        collect(block)
        for node in stack:
            self.uses[node] += 1
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            for argument in node.args:
                self.uses[argument] += 1
                stack.append(argument)

    def shared(self, node: Node) -> bool:
        """Whether a node becomes a local."""
        if node.op in ("const", "counter"):
            return False
        if node in self.trace.names or node in self.kept:
            return True
        if node.op in ("field", "element", "read"):
            return False
        return self.uses[node] > 1 and (node.kind != "int" or node.op == "segment")
