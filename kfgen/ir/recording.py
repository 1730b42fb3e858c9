"""What a trace records: statements, and nodes as they are first made, scope by scope."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from kfgen.ir.nodes import Node, Pool
from kfgen.ir.program import Statement


@dataclass
class Block:
    """What was recorded in one scope: statements, and nodes where they were first made."""

    items: list[Statement | Node] = field(default_factory=list)


class RecordingPool(Pool):
    """A pool that leaves each new node in the current block, where it was first made."""

    def __init__(self) -> None:
        self.block = Block()
        self._made: list[tuple[Any, ...]] = []
        super().__init__()

    def _was_made(self, key: tuple[Any, ...], node: Node) -> None:
        if node.op != "const":
            self.block.items.append(node)
            self._made.append(key)

    def fresh(self, op: str, args: tuple[Node, ...], data: object, kind: str) -> Node:
        node = super().fresh(op, args, data, kind)
        self.block.items.append(node)
        return node

    def mark(self) -> int:
        return len(self._made)

    def forget(self, mark: int) -> None:
        for key in self._made[mark:]:
            self._nodes.pop(key, None)
        del self._made[mark:]
