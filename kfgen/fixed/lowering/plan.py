"""Exponents of locals, chosen from how they are used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from kfgen.fixed.arithmetic.limits import BITS
from kfgen.fixed.lowering.expressions import Expressions
from kfgen.fixed.lowering.raw import Context
from kfgen.fixed.program.cells import Cell, number_of
from kfgen.fixed.program.nodes import terms, variables
from kfgen.ir.nodes import Node
from kfgen.ir.program import Assign, Let, Statement, Store, roots, walk


class Plan:
    """Exponents of locals, from the last use to the first: as fine as the products need in which they stand.

    A product of two numbers below 2^30 fits where it is shifted by 30. So a gain is given less head-room where the
    runs allow it, for the sake of plain multiply-adds that cannot overflow.
    """

    def __init__(self, context: Context, x: Expressions, ties: dict[str, Cell], exponent: Callable[[Cell], int],
                 target: Callable[[Store | Assign], Cell]) -> None:  # fmt: skip
        self.c = context
        self.x = x
        self.ties = ties
        self.exponent = exponent
        self.target = target
        self.wants: dict[str, list[int]] = {}
        self.added: dict[str, list[int]] = {}
        self.uses: Counter[str] = Counter()
        self.unlimited: Counter[str] = Counter()
        self.nodes: dict[str, Node] = {}

    def run(self, body: list[Statement]) -> None:
        for s in walk(body):
            if isinstance(s, Let) and s.node.kind == "real":
                self.nodes[s.name] = self.c.nodes[s.name] = s.node
            self.uses.update(variables(s))
        for s in reversed(list(walk(body))):
            if isinstance(s, Let) and s.node.kind == "real":
                self._let(s)
            elif isinstance(s, Store | Assign) and s.node.kind == "real":
                self._visit(s.node, self.exponent(self.target(s)))
            else:
                for root in roots(s):
                    self._visit(root, None)

    def _let(self, s: Let) -> None:
        e = self.exponent(self.ties[s.name]) if s.name in self.ties else None
        natural, least = self.c.formats.node(s.node), self.c.formats.least(s.node)
        wants = self.wants.get(s.name, [])
        given = s.node.op == "sum" and any(a.op == "field" for a in s.node.args)  # by the user: all of it is to fit
        if e is None and wants and not given and natural is not None and least is not None:
            fitting = [w for w in wants if least <= w < natural]
            if fitting:
                e = self.c.planned[s.name] = min(fitting)
            elif min(wants) > natural + 2:  # finer than the products that it is in can use
                e = self.c.planned[s.name] = min(min(wants) - 2, natural + 5)
        if self.unlimited[s.name] == self.uses[s.name]:
            self.c.unlimited.add(s.name)
        added = self.added.get(s.name, [])
        dropped = added and len(added) == self.uses[s.name] and natural is not None and min(added) > natural
        if e is None and s.node.op == "mul" and dropped:  # its last digits, wherever it is added
            e = self.c.planned[s.name] = min(added)
        self._visit(s.node, e)

    def _of(self, node: Node) -> int | None:
        """The exponent that a factor will have."""
        if node.op == "variable":
            inner = self.nodes.get(node.data)
            if node.data in self.ties:
                return self.exponent(self.ties[node.data])
            if node.data in self.c.planned:
                return self.c.planned[node.data]
            return None if inner is None else self._of(inner) if inner.op in LEAVES else self.c.formats.node(inner)
        if node.op == "field":
            return self.exponent(number_of(self.c.function, node.data))
        if node.op in ("element", "read"):
            if not node.args:
                return self.exponent(("variable", self.c.function.name, node.data))
            return self.exponent(self.c.arrays.named(self.c.function, node.data, node.args[0]))
        if node.op == "neg":
            return self._of(node.args[0])
        return self.c.formats.node(node)

    def _visit(self, node: Node, e: int | None) -> None:
        if node.op in ("sum", "mul", "add", "sub"):
            e = self.c.formats.node(node) if e is None else e
            parts = [(1, node.args)] if node.op == "mul" else terms(node)
            for _, factors in parts:
                if len(factors) == 1 and factors[0].op == "mul":
                    factors = factors[0].args
                if len(factors) == 1 and factors[0].op == "variable" and e is not None:
                    self.added.setdefault(factors[0].data, []).append(e)
                if len(factors) == 2:
                    for a, b in (factors, factors[::-1]):
                        self._product(a, b, e)
                for f in factors:
                    self._visit(f, None)
            return
        if node.op in ("div", "lt", "le", "finite") and node.args[-1].op == "variable":
            self.unlimited[node.args[-1].data] += 1
        if node.op in ("lt", "le") and node.args[0].op == "variable":
            self.unlimited[node.args[0].data] += 1
        for a in node.args:
            self._visit(a, e if node.op == "select" else None)

    def _product(self, a: Node, b: Node, e: int | None) -> None:
        """What a has to be for a b to fit."""
        if a.op == "neg":
            a = a.args[0]
        partner = None if b.constant is not None else self._of(b)
        if a.op == "variable" and e is not None and partner is not None:
            self.wants.setdefault(a.data, []).append(e - partner - BITS)


LEAVES = ("element", "field", "read", "variable")
