"""Which locals lead from the reading of a cell to its storing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from kfgen.fixed.program.cells import Arrays, Cell
from kfgen.fixed.program.nodes import terms
from kfgen.ir.nodes import Node
from kfgen.ir.program import Function, Let, Statement, Store, walk


def stores_to(function: Function, arrays: Arrays, s: Statement) -> Cell | None:
    """The cell that a statement stores, if it is one of an array and the same in every call."""
    if not isinstance(s, Store) or s.index is None or s.index.constant is None:
        return None
    return arrays.named(function, s.name, s.index)


def chained(functions: Iterable[Function], arrays: Arrays, cell: Cell) -> bool:
    """Whether every step and update makes the new value of a cell from the old one."""
    for f in functions:
        if f.private or f.name.endswith("_masked") or not (f.name == "predict" or f.name.startswith("update_")):
            continue
        nodes = {s.name: s.node for s in walk(f.body) if isinstance(s, Let) and s.node.kind == "real"}
        path = Path(f, arrays, nodes, cell)
        for s in walk(f.body):
            if isinstance(s, Store) and stores_to(f, arrays, s) == cell and path.depth(s.node) is None:
                return False
    return True


class Path:
    """The shortest way from an expression to the element of a cell: by terms and factors, not by divisors."""

    def __init__(self, function: Function, arrays: Arrays, nodes: Mapping[str, Node], cell: Cell) -> None:
        self.function = function
        self.arrays = arrays
        self.nodes = nodes
        self.cell = cell
        self.known: dict[int, int | None] = {}

    def depth(self, node: Node) -> int | None:
        if id(node) not in self.known:
            self.known[id(node)] = None
            self.known[id(node)] = self._depth(node)
        return self.known[id(node)]

    def _depth(self, node: Node) -> int | None:
        match node.op:
            case "element":
                if node.args[0].constant is None:
                    return None
                found = self.arrays.named(self.function, node.data, node.args[0])
                return 0 if found == self.cell else None
            case "variable":
                inner = self.nodes.get(node.data)
                inside = [] if inner is None else [inner]
            case "sum" | "add" | "sub" | "mul" | "neg":
                inside = list(node.args)
            case "select":
                inside = list(node.args[1:])
            case _:
                return None
        found_ = [d for d in map(self.depth, inside) if d is not None]
        return min(found_) + 1 if found_ else None

    def ordered(self, factors: tuple[Node, ...]) -> tuple[Node, Node]:
        """Of two factors the one that leads to the cell, and the other."""
        a, b = factors
        return (a, b) if self.nearest([(a,), (b,)]) == 0 else (b, a)

    def nearest(self, products: list[tuple[Node, ...]]) -> int:
        """Which of several products leads there first."""
        depths = [min((d for d in map(self.depth, f) if d is not None), default=1 << 30) for f in products]
        return depths.index(min(depths))

    def names(self, node: Node) -> list[str] | None:
        """The locals on the way; None where there is no way."""
        if self.depth(node) is None:
            return None
        out: list[str] = []
        waiting = [node]
        while waiting:
            node = waiting.pop()
            match node.op:
                case "variable":
                    out.append(node.data)
                    waiting.append(self.nodes[node.data])
                case "neg":
                    waiting += node.args
                case "mul" | "add" | "sub":
                    waiting.append(self.ordered(node.args)[0])
                case "sum":
                    waiting.append(self._term(node))
                case "select":
                    waiting += [a for a in node.args[1:] if self.depth(a) is not None]
        return out

    def _term(self, node: Node) -> Node:
        products = [factors for _, factors in terms(node)]
        factors = products[self.nearest(products)]
        return factors[0] if len(factors) == 1 else self.ordered(factors)[0]
