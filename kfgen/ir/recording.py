"""What a trace records: statements, and nodes as they are first made, scope by scope."""

from __future__ import annotations

from dataclasses import dataclass, field

from kfgen.ir.nodes import REAL, Node, Pool
from kfgen.ir.program import Statement


@dataclass
class Block:
    """What was recorded in one scope: statements, and nodes where they were first made."""

    items: list[Statement | Node] = field(default_factory=list)


class RecordingPool(Pool):
    """A pool that leaves each new node in the current block, where it was first made."""

    def __init__(self) -> None:
        self.block = Block()
        self._made: list[tuple[object, ...]] = []
        super().__init__()

    def make(self, op: str, args: tuple[Node, ...] = (), data: object = None, kind: str = REAL,
             volatile: bool = False) -> Node:  # fmt: skip
        before = self._count
        node = super().make(op, args, data, kind, volatile)
        if self._count != before and op != "const":
            self.block.items.append(node)
            self._made.append((op, tuple(a.serial for a in args), data, kind))
        return node

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
