"""From a recording to a scheduled program: sums of products fused, dead values dropped, shared ones named.

A value that is used once stands inside the expression that uses it; one that is used more often, or that
the algorithm named, becomes a constant local where it was first made. That order, the algorithm's, keeps
live ranges short.
"""

from __future__ import annotations

from dataclasses import replace

from kfgen.ir.nodes import Node
from kfgen.ir.overwritten import Overwritten
from kfgen.ir.program import Declare, For, If, Let, Section, Statement, mapped
from kfgen.ir.recording import Block
from kfgen.ir.sharing import Sharing
from kfgen.ir.trace import Trace

MAX_TERMS = 24  # of one sum: beyond it a sum stays nested, for the reader's sake


def schedule(trace: Trace, taken: frozenset[str] = frozenset()) -> list[Statement]:
    """The statements of a traced function, every shared value with its Let.

    taken: names that locals must not have (arguments, macros, emitted functions).
    """
    return _Scheduler(trace, taken).run()


class _Scheduler:
    def __init__(self, trace: Trace, taken: frozenset[str]) -> None:
        self.trace = trace
        self.taken = set(taken)
        sharing = Sharing(trace)
        self.uses = sharing.uses
        self.shared = sharing.shared
        self.overwritten = Overwritten(trace.blocks, sharing)
        self.fused: dict[Node, Node] = {}
        self.local: dict[Node, Node] = {}
        self.temporaries = 0

    def run(self) -> list[Statement]:
        for block in (self.trace.block, *self.trace.blocks.values()):
            self.taken |= {item.name for item in block.items if isinstance(item, Declare)}
            self.taken |= {item.variable for item in block.items if isinstance(item, For)}
        return self._block(self.trace.block)

    # fusing ------------------------------------------------------------------------------------------

    def _terms(self, node: Node, sign: int, top: bool, out: list[tuple[int, list[Node]]]) -> None:
        """The signed terms of a tree of additions whose inner nodes are used once."""
        inner = top or not (self.shared(node) or node in self.local)
        if inner and node.op in ("add", "sub"):
            self._terms(node.args[0], sign, False, out)
            self._terms(node.args[1], sign if node.op == "add" else -sign, False, out)
        elif inner and node.op == "neg":
            self._terms(node.args[0], -sign, False, out)
        elif inner and not top and node.op == "mul":
            out.append((sign, [node.args[0], node.args[1]]))
        else:
            out.append((sign, [node]))

    def _fuse(self, node: Node) -> Node:
        """The node with its sums of products fused; locals stay what they are."""
        found = self.fused.get(node)
        if found is not None:
            return found
        if node.kind != "int" and node.op in ("add", "sub") and node.args[0].kind != "int":
            terms: list[tuple[int, list[Node]]] = []
            self._terms(node, 1, True, terms)
            if terms[0][0] < 0:  # begin with a positive term where there is one
                first = next((i for i, (s, _) in enumerate(terms) if s > 0), 0)
                terms.insert(0, terms.pop(first))
            if len(terms) <= MAX_TERMS:
                args = tuple([self._operand(f) for _, factors in terms for f in factors])
                data = tuple([(s, len(factors)) for s, factors in terms])
                result = Node("sum", args, data, node.kind, node.serial, node.volatile)
                self.fused[node] = result
                return result
        args = tuple([self._operand(a) for a in node.args])
        result = node if not args else Node(node.op, args, node.data, node.kind, node.serial, node.volatile)
        self.fused[node] = result
        return result

    def _operand(self, node: Node) -> Node:
        """A node as it stands in another's expression: its local, or itself, inlined."""
        if self.shared(node) or node in self.local:
            return self._local(node)
        return self._fuse(node)

    def _local(self, node: Node) -> Node:
        found = self.local.get(node)
        if found is None:
            name = self.trace.names.get(node)
            found = Node("variable", (), self._unique(name or "t", name is None), node.kind, node.serial, False)
            self.local[node] = found
        return found

    def _unique(self, base: str, numbered: bool) -> str:
        while True:
            if numbered:
                name = f"{base}{self.temporaries}"
                self.temporaries += 1
            else:
                name = base
            if name not in self.taken:
                self.taken.add(name)
                return name
            if not numbered:
                suffix = 1
                while f"{base}_{suffix}" in self.taken:
                    suffix += 1
                base = f"{base}_{suffix}"

    # statements --------------------------------------------------------------------------------------

    def _block(self, block: Block) -> list[Statement]:
        self.overwritten.keep(block)
        early = self.overwritten.early(block)
        for node in early:
            self._local(node)
        lets = set(early)
        out: list[Statement] = []
        for item in block.items:
            if isinstance(item, Node):
                if self.uses[item] and (self.shared(item) or item in lets):
                    out.append(Let(self._fuse(item), self._local(item).data))
                continue
            out.append(self._statement(item))
        return _without_empty_sections(out)

    def _statement(self, item: Statement) -> Statement:
        if isinstance(item, For):
            item = replace(item, body=self._block(self.trace.blocks[id(item)]))
        made = mapped(item, self._operand)
        return replace(made, body=self._block(self.trace.blocks[id(item)])) if isinstance(made, If) else made


def _without_empty_sections(body: list[Statement]) -> list[Statement]:
    out: list[Statement] = []
    for statement in body:
        if isinstance(statement, Section) and out and isinstance(out[-1], Section):
            out.pop()
        out.append(statement)
    if out and isinstance(out[-1], Section):
        out.pop()
    return out
