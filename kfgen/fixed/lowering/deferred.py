"""Deferred divisions: quotients of which runs have met so many sizes that they are not kept in one format."""

from __future__ import annotations

from dataclasses import replace

from kfgen.fixed.lowering.expressions import Expressions
from kfgen.fixed.lowering.raw import Context, Raw
from kfgen.fixed.program.nodes import make
from kfgen.ir.nodes import Node
from kfgen.ir.program import Let, Statement

DYNAMIC = 1024  # times its smallest size: a reciprocal whose runs span more than this is deferred
SPREAD = 2.0**12  # times its usual size: a quotient that becomes so large is deferred


class Deferred:
    """The locals of one function that are deferred: what they are made of is noted in the context instead."""

    def __init__(self, context: Context, x: Expressions) -> None:
        self.c = context
        self.x = x

    def inverse(self, s: Let) -> list[Statement] | None:
        """A reciprocal whose size varies much is not kept: every quotient is divided."""
        condition, node = _guarded(s.node)
        if node.op != "div" or node.args[0].constant is None:
            return None
        ranges = self.c.formats.ranges
        largest, smallest = ranges.largest(node), ranges.smallest(node)
        if node.args[0].constant != 1:
            return None
        if self.c.formats.more:  # the runs may not have met the smallest divisor
            if self.x.value(node.args[1]).low > 0 and largest <= DYNAMIC * smallest:
                return None
        elif largest == 0 or largest <= DYNAMIC * smallest:
            return None
        out: list[Statement] = []
        test = self._tested(s.name, condition, out)
        self.c.inverses[s.name] = (self._simple(f"{s.name}_of", node.args[1], out), test)
        self.c.known[f"1/{s.name}"] = node
        return out

    def ratio(self, s: Let) -> list[Statement] | None:
        """A quotient that is far larger now and then than it usually is: it is made with each product that it is in."""
        if self.c.formats.ranges.spread(self.c.function.name, s.name) <= SPREAD:
            return None
        condition, node = _guarded(s.node)
        out: list[Statement] = []
        if node.op == "div":
            num, den, test = node.args[0], self._simple(f"{s.name}_of", node.args[1], out), None
        elif node.op == "mul" and any(a.data in self.c.inverses for a in node.args):
            num, inverse = node.args if node.args[1].data in self.c.inverses else node.args[::-1]
            den, test = self.c.inverses[inverse.data]
        else:
            return None
        test = self._tested(s.name, condition, out) if test is None else test
        self.c.ratios[s.name] = (self._simple(f"{s.name}_by", num, out), den, test)
        return out

    def _tested(self, name: str, condition: Node | None, out: list[Statement]) -> Node | None:
        """A condition as a truth value that is kept."""
        test = None if condition is None else self.x.index(condition)
        if test is None or test.op == "variable":
            return test
        out.append(Let(test, f"{name}_some"))
        return make("variable", (), f"{name}_some", "bool")

    def _simple(self, name: str, node: Node, out: list[Statement]) -> Raw:
        """A value that is kept."""
        raw = self.x.value(node)
        if raw.node.op in ("variable", "element", "field"):
            return raw
        out.append(Let(raw.node, name, raw.e))
        return replace(raw, node=make("variable", (), name))


def _guarded(node: Node) -> tuple[Node | None, Node]:
    """The condition of a choice that is 0 where it does not hold, and what is taken where it does."""
    if node.op == "select" and node.args[2].constant == 0:
        return node.args[0], node.args[1]
    return None, node
