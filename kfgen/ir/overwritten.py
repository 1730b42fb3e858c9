"""Which values must be evaluated where they were made, for what they read is written before they are used."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from kfgen.ir.nodes import Node
from kfgen.ir.program import Assign, Call, For, If, Slice, Store, roots
from kfgen.ir.recording import Block
from kfgen.ir.sharing import Sharing


class Overwritten:
    """Finds them in a block at a time. blocks: id(For or If) -> its recorded body."""

    def __init__(self, blocks: Mapping[int, Block], sharing: Sharing) -> None:
        self.blocks = blocks
        self.uses = sharing.uses
        self.shared = sharing.shared
        self.kept = sharing.kept

    def keep(self, block: Block) -> None:
        """Fields that are read after they have been stored are kept in a local from before."""
        stored: set[tuple[str, Fraction | None]] = set()
        for item in block.items:
            if isinstance(item, Node):
                if not (self.uses[item] and self.shared(item)):
                    continue
                reads = list(item.args)
            else:
                reads = roots(item)
            met: set[int] = set()
            while reads and stored:
                node = reads.pop()
                if node.serial in met:
                    continue
                met.add(node.serial)
                if node in self.kept or (self.shared(node) and node.op not in ("field", "element")):
                    continue
                if (node.op == "element" and (node.data, node.args[0].constant) in stored) or (
                    node.op == "field" and (node.data, None) in stored
                ):
                    self.kept.add(node)
                reads.extend(node.args)
            if isinstance(item, Store):
                stored.add((item.name, None if item.index is None else item.index.constant))

    def early(self, block: Block) -> list[Node]:
        """Single-use values that read memory which is written between their making and their use, as they are met."""
        position: dict[Node, int] = {}
        epoch = 0
        forced: dict[Node, None] = {}
        for item in block.items:
            if isinstance(item, Node):
                position[item] = epoch
                if not (self.uses[item] and self.shared(item)):
                    continue
                stack = [(a, epoch) for a in item.args if a.volatile]  # a local: evaluated here
            else:
                stack = [(n, epoch) for n in roots(item) if n.volatile]
            met: set[tuple[int, int]] = set()
            while stack:
                node, when = stack.pop()
                if (node.serial, when) in met:
                    continue
                met.add((node.serial, when))
                made = position.get(node)
                if made is not None and self.shared(node):
                    continue
                if made is not None and made != when and node.kind != "int":
                    forced[node] = None
                    when = made
                stack.extend((a, when) for a in node.args if a.volatile)
            if isinstance(item, For | If):
                forced |= dict.fromkeys(self._overtaken(item, position))
            if isinstance(item, Assign | Call | For | If):
                epoch += 1
        return list(forced)

    def _overtaken(self, item: For | If, position: dict[Node, int]) -> list[Node]:
        """Values made before a body that are evaluated in it, and read what it writes."""
        used, written = self._inside(item)
        reads: dict[Node, bool] = {}

        def overtaken(node: Node) -> bool:
            if node not in reads:
                own = node.op == "read" and node.data in written
                inlined = node.volatile and not self.shared(node)
                reads[node] = inlined and (own or any(overtaken(a) for a in node.args))
            return reads[node]

        out: list[Node] = []
        met: set[Node] = set()
        while used:
            node = used.pop()
            if node in met or not overtaken(node):
                continue
            met.add(node)
            if node in position:
                if node.kind != "int":
                    out.append(node)
                continue
            used += node.args
        return out

    def _inside(self, item: For | If) -> tuple[list[Node], set[str]]:
        """The nodes that the statements of a body evaluate, and the locals that they write, at any depth."""
        used: list[Node] = []
        written: set[str] = set()
        for inner in self.blocks[id(item)].items:
            if isinstance(inner, Node):
                continue
            used += roots(inner)
            if isinstance(inner, Assign):
                written.add(inner.name)
            elif isinstance(inner, Call):
                written |= {given.array for a, given in zip(inner.callee.arguments, inner.args, strict=True)
                            if isinstance(given, Slice) and not a.constant}  # fmt: skip
            elif isinstance(inner, For | If):
                nodes, names = self._inside(inner)
                used += nodes
                written |= names
        return used, written
