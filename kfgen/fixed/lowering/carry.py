"""What small noise needs: digits below the LSB of a state or a variance, kept from one call to the next.

A sum that is rounded in every step is off by as much as half an LSB a step; where the noise of a step is no more than
a few LSBs, or a state is corrected by as little, that piles up. A carried cell has a second word, `kf.rest`, of
CARRIED bits: its chain of locals, from the element's reading to its storing, is written once more in 64 bits.
"""

from __future__ import annotations

from dataclasses import replace

from kfgen.fixed.arithmetic.limits import BITS, LIMIT
from kfgen.fixed.arithmetic.rounding import nearest
from kfgen.fixed.formats.carried import CARRIED
from kfgen.fixed.lowering.expressions import Expressions
from kfgen.fixed.lowering.raw import Context, Raw
from kfgen.fixed.program.cells import Cell, affine
from kfgen.fixed.program.chains import Path, stores_to
from kfgen.fixed.program.nodes import constant, integer, make, same, terms
from kfgen.ir.nodes import Node
from kfgen.ir.program import Function, Let, Statement, Store, walk

LONG = "long"  # the kind of a node of 64 bits
SUFFIX = "_long"
ONE = 1 << CARRIED
MINUS = Raw(constant(-ONE * 2), -CARRIED - 1, -ONE * 2, -ONE * 2)
_TERMS = ("q_gather", "q_stretch")


class Carry:
    """The carried cells of one function. Raises nothing: what has no chain is rounded as ever."""

    def __init__(self, context: Context, x: Expressions) -> None:
        self.c = context
        self.x = x
        self.cells = context.formats.carried
        self.members: dict[str, Cell] = {}  # locals of chains
        self.stores: dict[int, Cell] = {}

    def find(self, function: Function) -> None:
        """The chains of all stores. The expressions of locals are known by now."""
        if not self.cells:
            return
        for s in walk(function.body):
            cell = self.cell_of(s)
            if cell is not None and isinstance(s, Store):
                path = self._path(cell)
                names = path.names(s.node)
                if names is not None and not any(self.members.get(name, cell) != cell for name in names):
                    self.members.update(dict.fromkeys(names, cell))
                    self.stores[id(s)] = cell

    def _path(self, cell: Cell) -> Path:
        return Path(self.c.function, self.c.arrays, self.c.nodes, cell)

    def cell_of(self, s: Statement) -> Cell | None:
        """The carried cell that a statement stores."""
        cell = stores_to(self.c.function, self.c.arrays, s)
        return cell if cell in self.cells else None

    def local(self, s: Let) -> list[Statement]:
        """A local of a chain in 64 bits, beside the rounded one."""
        cell = self.members.get(s.name)
        return [] if cell is None else _by_terms(self.long(s.node, cell), s.name + SUFFIX, self._point(cell))

    def cleared(self, cell: Cell) -> Store:
        """What forgets the rest of a cell that is given anew."""
        return Store("kf.rest", integer(self.cells[cell]), constant(0))

    def kept(self, s: Store, cell: Cell) -> tuple[list[Statement], Node, Store] | None:
        """What a store has to make before it, the rounded value, and the store of the rest; None without a chain."""
        if id(s) not in self.stores:
            return None
        lets: list[Statement] = []
        long = self.long(s.node, cell)
        if long.op != "variable":
            name = f"{s.name.rpartition('.')[2].lower()}_{affine(s.index)[0] if s.index is not None else 0}{SUFFIX}"
            lets += _by_terms(long, name, self._point(cell))
            long = make("variable", (), name, LONG)
        rest = make("q_rest", (long,), (CARRIED,))
        return lets, make("q_word", (long,), (CARRIED,)), replace(self.cleared(cell), node=rest)

    def _point(self, cell: Cell) -> int:
        """The exponent of a chain's words."""
        return self.c.formats.fixed[cell] - CARRIED

    def long(self, node: Node, cell: Cell) -> Node:
        """An expression on a chain, in 64 bits, with CARRIED bits more than its cell has."""
        e = self._point(cell)
        path = self._path(cell)
        match node.op:
            case "element" if path.depth(node) == 0:
                rest = make("element", (integer(self.cells[cell]),), "kf.rest")
                raw = self.x.value(node)
                return make("q_gather", (rest, raw.node, constant(ONE)), (0,), LONG)
            case "variable" if node.data in self.members:
                return make("variable", (), node.data + SUFFIX, LONG)
            case "select":
                branches = (self.long(a, cell) for a in node.args[1:])
                return make("select", (self._condition(node.args[0], cell), *branches), None, LONG)
            case "neg":
                return self._scaled(self.long(node.args[0], cell), MINUS)
            case "mul" if path.depth(node) is not None:
                a, b = path.ordered(node.args)
                taken = self._taken(a, b)
                if taken is not None:
                    return self._plus(self.long(a, cell), -1, taken, e)
                factor = self.x.factor(b)
                finest = -CARRIED - 1
                if factor.e > finest and factor.size << (factor.e - finest) <= LIMIT:
                    factor = self.x.at(factor, finest)
                if factor.e <= finest:  # or the factor may be so large that what it multiplies has to be small
                    return self._scaled(self.long(a, cell), factor)
            case "sum" | "add" | "sub" if path.depth(node) is not None:
                return self._sum(node, cell, e)
        return self._plus(constant(0), 1, (node,), e)

    def _condition(self, node: Node, cell: Cell) -> Node:
        """A choice; what is compared to a limit is the word, which has room for more than the rounded local may."""
        limits = [a.constant is not None for a in node.args]
        if node.op in ("lt", "le") and any(limits):
            a = node.args[limits.index(False)]
            if a.op == "variable" and a.data in self.members:
                e = self.c.formats.fixed[cell]
                word = Raw(make("q_word", (self.long(a, cell),), (CARRIED,)), e)
                return self.x.beside(node, word, limits[0])
        return self.x.index(node)

    def _sum(self, node: Node, cell: Cell, e: int) -> Node:
        path = self._path(cell)
        parts = terms(node)
        chain = path.nearest([factors for _, factors in parts])
        sign, factors = parts.pop(chain)
        total = self.long(factors[0] if len(factors) == 1 else make("mul", factors), cell)
        if sign < 0:
            total = self._scaled(total, MINUS)
        for sign, factors in parts:
            total = self._plus(total, sign, factors, e)
        return total

    def _taken(self, D: Node, ratio: Node) -> tuple[Node, Node] | None:
        """Where D is multiplied by s / (s + f v), v = f D, the factors v and v / (s + f v) of what that takes from D.

        f v can be below the LSB that s and the ratio have, and yet be what D is to lose.
        """
        parts = self._quotient(ratio)
        if parts is None:
            return None
        before, after = parts
        whole = self.x.definition(after)
        if whole.op != "sum" or not any(len(f) == 1 and same(f[0], before) for _, f in terms(whole)):
            return None
        for _, factors in terms(whole):
            if len(factors) < 2:
                continue
            for v, f in (factors, factors[::-1]):  # where f is weighed, v is not f D
                for name, node in self.c.nodes.items() if self._is_product(v, f, D) else ():
                    found = self._quotient(node)
                    if found is not None and same(found[0], v) and same(found[1], after):
                        return v, make("variable", (), name)
        return None

    def _is_product(self, v: Node, a: Node, b: Node) -> bool:
        product = self.x.definition(v)
        if v.op != "variable" or product.op != "mul":
            return False
        one, two = product.args
        return (same(one, a) and same(two, b)) or (same(one, b) and same(two, a))

    def _quotient(self, node: Node) -> tuple[Node, Node] | None:
        """Numerator and denominator, of a division or of a product with a reciprocal; whatever guards it."""
        node = self._unguarded(node)
        if node.op == "div":
            return node.args[0], node.args[1]
        if node.op == "mul":
            for a, b in (node.args, node.args[::-1]):
                inverse = self._unguarded(b)
                if inverse.op == "div" and inverse.args[0].constant == 1:
                    return a, inverse.args[1]
        return None

    def _unguarded(self, node: Node) -> Node:
        node = self.x.definition(node)
        while node.op == "select":
            node = self.x.definition(node.args[1])
        return node

    def _scaled(self, long: Node, b: Raw) -> Node:
        return make("q_stretch", (long, b.node), (-b.e,), LONG)

    def _plus(self, total: Node, sign: int, factors: tuple[Node, ...], e: int) -> Node:
        """total + sign times a value or a product of two."""
        if len(factors) == 1 and factors[0].op == "mul":
            factors = factors[0].args
        if len(factors) == 1:
            return self._whole(total, sign, factors[0], e)
        a, b = map(self.x.factor, factors)
        if sign < 0:
            a, b = (a, self.x.negative(b)) if b.node.constant is not None else (self.x.negative(a), b)
        return self._gathered(total, a, b, e)

    def _whole(self, total: Node, sign: int, node: Node, e: int) -> Node:
        """total + sign times one value, which 2^k brings to e."""
        if node.constant == 0:
            return total
        if node.constant is not None:
            number = nearest(node.constant, e)
            a = Raw(constant(number), e, number, number) if abs(number) <= LIMIT else self.x.value(node, e + CARRIED)
        else:
            a = self.x.factor(node)
        k = max(0, min(a.e - e, BITS))
        return self._gathered(total, a, Raw(constant(sign << k), -k, sign << k, sign << k), e)

    def _gathered(self, total: Node, a: Raw, b: Raw, e: int) -> Node:
        s = e - a.e - b.e
        if s < 0 and a.size << min(-s, BITS) > LIMIT and a.node.constant is None and b.node.constant is None:
            # in the cell's own format it fits where the cell does; shifted by so much, a factor may not
            a = self.x.scaled_product(a, b, e + CARRIED)
            b = Raw(constant(ONE), -CARRIED, ONE, ONE)
        elif s < 0:
            a = self.x.at(a, a.e + s)
        elif s > 62:
            a = self.x.at(a, a.e + s - 62)
        return make("q_gather", (total, a.node, b.node), (e - a.e - b.e,), LONG)


def _by_terms(node: Node, name: str, e: int) -> list[Statement]:
    """A local of 64 bits, a statement for each term of its sum."""
    out = [Let(node, name, e)]
    while node.op in _TERMS and node.args[0].op in _TERMS:
        inner, before = node.args[0], f"{name}{len(out)}"
        first = make("variable", (), before, LONG)
        out[-1] = replace(out[-1], node=make(node.op, (first, *node.args[1:]), node.data, LONG))
        out.append(Let(inner, before, e))
        node = inner
    return [*reversed(out)]
