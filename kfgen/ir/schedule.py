"""From a recording to a scheduled program: sums of products fused, dead values dropped, shared ones named.

A value that is used once stands inside the expression that uses it; one that is used more often, or that
the algorithm named, becomes a constant local where it was first made. That order, the algorithm's, keeps
live ranges short.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from fractions import Fraction

from kfgen.ir.nodes import Node
from kfgen.ir.program import (
    Assign,
    Call,
    Declare,
    Flag,
    For,
    Guard,
    If,
    Let,
    Section,
    Slice,
    Statement,
    Store,
    roots,
)  # fmt: skip
from kfgen.ir.trace import Block, Trace

_BASE = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow",
         "fabs", "floor", "ceil", "hypot", "fmin", "fmax", "fma")  # fmt: skip
LIBRARY_NAMES = frozenset(name + suffix for name in _BASE for suffix in ("", "f"))
# names that a local must not take: what the text around it uses, functions of <math.h>
_TAKEN = """kf flags order i j k sum p w total real j0 j1 jn y0 y1 yn gamma signgam erf erfc log2 log10 exp2
cbrt round trunc isnan isinf isfinite NULL int8_t int16_t int32_t uint8_t uint16_t uint32_t"""
RESERVED = LIBRARY_NAMES | frozenset(_TAKEN.split())
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
        self.uses: Counter[Node] = Counter()
        self.fused: dict[Node, Node] = {}
        self.local: dict[Node, Node] = {}
        self.temporaries = 0
        self.kept: set[Node] = set()

    def run(self) -> list[Statement]:
        for block in (self.trace.block, *self.trace.blocks.values()):
            self.taken |= {item.name for item in block.items if isinstance(item, Declare)}
            self.taken |= {item.variable for item in block.items if isinstance(item, For)}
        self._count(self.trace.block)
        return self._block(self.trace.block)

    # uses: a node counts once per place that evaluates it --------------------------------------------

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

    def _shared(self, node: Node) -> bool:
        """Whether a node becomes a local."""
        if node.op in ("const", "counter"):
            return False
        if node in self.trace.names or node in self.kept:
            return True
        if node.op in ("field", "element", "read"):
            return False
        return self.uses[node] > 1 and (node.kind != "int" or node.op == "segment")

    # fusing ------------------------------------------------------------------------------------------

    def _terms(self, node: Node, sign: int, top: bool, out: list[tuple[int, list[Node]]]) -> None:
        """The signed terms of a tree of additions whose inner nodes are used once."""
        inner = top or not (self._shared(node) or node in self.local)
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
                args = tuple(self._operand(f) for _, factors in terms for f in factors)
                data = tuple((s, len(factors)) for s, factors in terms)
                result = Node("sum", args, data, node.kind, node.serial, node.volatile)
                self.fused[node] = result
                return result
        args = tuple(self._operand(a) for a in node.args)
        result = node if not args else Node(node.op, args, node.data, node.kind, node.serial, node.volatile)
        self.fused[node] = result
        return result

    def _operand(self, node: Node) -> Node:
        """A node as it stands in another's expression: its local, or itself, inlined."""
        if self._shared(node) or node in self.local:
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
        self._snapshots(block)
        lets = self._forced_lets(block)
        out: list[Statement] = []
        for item in block.items:
            if isinstance(item, Node):
                if self.uses[item] and (self._shared(item) or item in lets):
                    out.append(Let(self._fuse(item), self._local(item).data))
                continue
            out.append(self._statement(item))
        return _without_empty_sections(out)

    def _snapshots(self, block: Block) -> None:
        """Fields that are read after they have been stored are kept in a local from before."""
        stored: set[tuple[str, Fraction | None]] = set()
        for item in block.items:
            if isinstance(item, Node):
                if not (self.uses[item] and self._shared(item)):
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
                if node in self.kept or (self._shared(node) and node.op not in ("field", "element")):
                    continue
                if (node.op == "element" and (node.data, node.args[0].constant) in stored) or (
                    node.op == "field" and (node.data, None) in stored
                ):
                    self.kept.add(node)
                reads.extend(node.args)
            if isinstance(item, Store):
                stored.add((item.name, None if item.index is None else item.index.constant))

    def _forced_lets(self, block: Block) -> set[Node]:
        """Single-use values that read memory which is written between their making and their use."""
        position: dict[Node, int] = {}
        epoch = 0
        forced: set[Node] = set()
        for item in block.items:
            if isinstance(item, Node):
                position[item] = epoch
                if not (self.uses[item] and self._shared(item)):
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
                if made is not None and self._shared(node):
                    continue
                if made is not None and made != when and node.kind != "int":
                    forced.add(node)
                    self._local(node)
                    when = made
                stack.extend((a, when) for a in node.args if a.volatile)
            if isinstance(item, For | If):
                forced |= self._overtaken(item, position)
            if isinstance(item, Assign | Call | For | If):
                epoch += 1
        return forced

    def _overtaken(self, item: For | If, position: dict[Node, int]) -> set[Node]:
        """Values made before a body that are evaluated in it, and read what it writes."""
        used, written = self._inside(item)
        reads: dict[Node, bool] = {}

        def overtaken(node: Node) -> bool:
            if node not in reads:
                own = node.op == "read" and node.data in written
                inlined = node.volatile and not self._shared(node)
                reads[node] = inlined and (own or any(overtaken(a) for a in node.args))
            return reads[node]

        out: set[Node] = set()
        met: set[Node] = set()
        while used:
            node = used.pop()
            if node in met or not overtaken(node):
                continue
            met.add(node)
            if node in position:
                if node.kind != "int":
                    out.add(node)
                    self._local(node)
                continue
            used += node.args
        return out

    def _inside(self, item: For | If) -> tuple[list[Node], set[str]]:
        """The nodes that the statements of a body evaluate, and the locals that they write, at any depth."""
        used: list[Node] = []
        written: set[str] = set()
        for inner in self.trace.blocks[id(item)].items:
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

    def _statement(self, item: Statement) -> Statement:
        op = self._operand
        match item:
            case Store() | Assign():
                return replace(item, index=None if item.index is None else op(item.index), node=op(item.node))
            case Declare():
                return replace(item, value=None if item.value is None else op(item.value))
            case Guard():
                before = [replace(s, node=op(s.node)) for s in item.before]
                return replace(item, condition=op(item.condition), before=before)
            case Call(args=args):
                given = [replace(a, offset=op(a.offset)) if isinstance(a, Slice) else op(a) if isinstance(a, Node)
                         else a for a in args]  # fmt: skip
                return replace(item, args=given)
            case Flag():
                return replace(item, condition=op(item.condition))
            case For():
                body = self._block(self.trace.blocks[id(item)])
                return replace(item, start=op(item.start), stop=op(item.stop), body=body)
            case If():
                return replace(item, condition=op(item.condition), body=self._block(self.trace.blocks[id(item)]))
            case _:
                return item


def _without_empty_sections(body: list[Statement]) -> list[Statement]:
    out: list[Statement] = []
    for statement in body:
        if isinstance(statement, Section) and out and isinstance(out[-1], Section):
            out.pop()
        out.append(statement)
    if out and isinstance(out[-1], Section):
        out.pop()
    return out
