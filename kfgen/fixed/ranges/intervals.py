"""What the model's values can be anywhere in the declared box: intervals of f, h, their slopes, and noises.

What depends on the covariance, or on a quantity of which neither spec nor runs tell anything, has no interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from kfgen.fixed.program.cells import plain
from kfgen.fixed.program.nodes import grouped
from kfgen.fixed.ranges import arithmetic as reckon
from kfgen.fixed.ranges.box import Box, Span
from kfgen.fixed.ranges.ranges import HUGE, Ranges
from kfgen.ir.nodes import Node
from kfgen.ir.program import For, Function, Guard, If, Let, Statement, Store, walk
from kfgen.model import Model


class Intervals:
    """The intervals of the nodes of functions.

    inner: node -> the span of all that is computed on the way to it (terms, partial sums) and of its value.
    sizes: node -> what none of that exceeds, in whichever order terms are added.
    """

    def __init__(self, model: Model, box: Box, ranges: Ranges) -> None:
        self.model = model
        self.box = box
        self.ranges = ranges
        self.inner: dict[Node, Span] = {}
        self.sizes: dict[Node, float] = {}
        self._known: dict[int, Span | None] = {}
        self._locals: dict[str, Node] = {}
        self._function = ""

    def read(self, functions: Iterable[Function]) -> None:
        """Find the intervals of all functions of a filter that are called from outside."""
        for f in functions:
            if not f.private:
                self._known, self._locals, self._function = {}, {}, f.name.removesuffix("_masked")
                self._block(f.body)

    def _block(self, body: list[Statement]) -> None:
        for s in body:
            match s:
                case Let(node=node, name=name):
                    self._locals[name] = node
                    self.value(node)
                case Store(node=node):
                    self.value(node)
                case Guard(condition=condition):
                    self.value(condition)
                case If(body=inner):
                    self._block(inner)
                case For(body=inner):
                    for each in walk(inner):
                        if isinstance(each, Let):
                            self._locals.pop(each.name, None)

    def value(self, node: Node) -> Span | None:
        """The span of a value."""
        key = id(node)
        if key not in self._known:
            try:
                found = self._value(node)
            except (OverflowError, ValueError):
                found = None
            if found is not None and not (-HUGE < found[0] <= found[1] < HUGE):
                found = None
            self._known[key] = found
            if found is not None and node.args and node.kind == "real":
                self._keep(node, found)
        return self._known[key]

    def _keep(self, node: Node, span: Span) -> None:
        self.sizes[node] = max(self.sizes.get(node, 0.0), size(span))
        before = self.inner.get(node)
        self.inner[node] = span if before is None else reckon.hull(before, span)

    def _bound(self, node: Node, terms: list[Span]) -> None:
        self.sizes[node] = max(self.sizes.get(node, 0.0), math.fsum(map(size, terms)))

    def _value(self, node: Node) -> Span | None:
        match node.op:
            case "const":
                return float(node.data), float(node.data)
            case "variable":
                return self.value(self._locals[node.data]) if node.data in self._locals else None
            case "field":
                return self._field(node.data)
            case "element":
                return self._element(node)
            case "select":
                return self._select(node)
            case "sum":
                return self._sum(node)
            case "lookup":
                numbers = [float(v) for v in node.data.numbers]
                return min(numbers), max(numbers)
            case "slope":
                slopes = [float(v) for v in node.data.slopes()]
                return min(slopes), max(slopes)
            case "table":
                a = self.value(node.args[1])
                return None if a is None else reckon.looked_up(node.data, a)
            case "read" | "real" | "counter" | "finite" | "bit" | "present" | "lt" | "le" | "and" | "or" | "not":
                return None
        args = [self.value(a) for a in node.args]
        known = [a for a in args if a is not None]
        if len(known) < len(args):
            return None
        return self._operation(node, known)

    def _operation(self, node: Node, args: list[Span]) -> Span | None:
        match node.op:
            case "add" | "sub":
                b = args[1] if node.op == "add" else reckon.minus(args[1])
                for a in args:
                    self._keep(node, a)
                self._bound(node, args)
                return reckon.plus(args[0], b)
            case "mul":
                same = self._same(*node.args)
                return reckon.square(args[0]) if same else reckon.times(*args)
            case "wrap":
                return reckon.wrapped(args[0], float(node.data))
        if node.op in reckon.UNARY:
            return reckon.UNARY[node.op](args[0])
        return reckon.BINARY[node.op](*args) if node.op in reckon.BINARY else None

    def _same(self, a: Node, b: Node) -> bool:
        return a is b or (a.op == b.op == "variable" and a.data == b.data)

    def _sum(self, node: Node) -> Span | None:
        total: Span | None = (0.0, 0.0)
        kept: list[Span] = []
        terms: list[Span] = []
        for sign, factors in grouped(node.data, node.args):
            spans = [self.value(f) for f in factors]
            known = [s for s in spans if s is not None]
            if len(known) < len(spans):
                total = None  # go on: the other terms are to be known
                continue
            term = known[0]
            if len(known) == 2:
                term = reckon.square(term) if self._same(*factors) else reckon.times(*known)
            if total is not None:
                total = reckon.plus(total, term if sign > 0 else reckon.minus(term))
                kept += [term, total]
                terms.append(term)
        if total is not None:
            self._bound(node, terms)
            self._keep(node, reckon.hull(*kept))
        return total

    def _select(self, node: Node) -> Span | None:
        truth = self._truth(node.args[0])
        branches = [self.value(a) for a in node.args[1:]]
        if truth is not None:
            return branches[0 if truth else 1]
        known = [b for b in branches if b is not None]
        return reckon.hull(*known) if len(known) == 2 else None

    def _truth(self, node: Node) -> bool | None:
        """Of a comparison that goes one way everywhere in the box."""
        if node.op == "variable" and node.data in self._locals:
            return self._truth(self._locals[node.data])
        if node.op not in ("lt", "le") or node.args[0].kind != "real":
            return None
        a, b = self.value(node.args[0]), self.value(node.args[1])
        if a is None or b is None:
            return None
        strict = node.op == "lt"
        if a[1] < b[0] or (not strict and a[1] <= b[0]):
            return True
        if a[0] > b[1] or (strict and a[0] >= b[1]):
            return False
        return None

    def _field(self, path: str) -> Span | None:
        prefix, _, name = path.partition(".")
        if path == "dt":
            return self.box.dt or self._met(("number", "dt"))
        if prefix == "u":
            return self.box.inputs.get(name) or self._met(("number", path))
        if path.startswith("kf.parameters."):
            return self.box.parameters.get(path.rpartition(".")[2]) or self._met(("number", path), False)
        if prefix == "z":
            sensor = self._function.removeprefix("update_")
            return self.box.readings.get((sensor, name)) or self._met(("number", self._function, path))
        return None

    def _element(self, node: Node) -> Span | None:
        index = node.args[0].constant
        if plain(node.data) != "kf.x" or index is None:
            return None
        return self.box.states[int(index)] or self._met(("array", node.data, int(index)))

    def _met(self, cell: tuple[object, ...], through_zero: bool = True) -> Span | None:
        """What runs have met of a quantity that the spec says nothing of."""
        i = self.ranges.index.get(cell)
        if i is None:
            return None
        low, high = self.ranges.low[i], self.ranges.high[i]
        if not through_zero and (low == 0 or high == 0):
            return (low + high, low + high)
        return low, high


def spread(intervals: Intervals, most: float) -> None:
    """Let the ranges take in the intervals, where these exceed what runs have met by no more than `most` times."""
    ranges = intervals.ranges
    for node, (low, high) in intervals.inner.items():
        met = ranges.largest(node)
        if max(high, -low) <= most * met or met == 0:
            ranges.see(node, low)
            ranges.see(node, high)


def size(span: Span) -> float:
    return max(math.fabs(span[0]), math.fabs(span[1]))
