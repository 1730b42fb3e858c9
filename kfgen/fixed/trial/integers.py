"""The integer program on Python integers: what its C computes, to the last bit."""

from __future__ import annotations

from typing import Any

from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.source import Source
from kfgen.fixed.trial.certificate import saturates
from kfgen.ir.nodes import Constants, Node
from kfgen.ir.program import Function


class _IntegerSource(Source):
    """Integer programs are run as they are; every operation is the scalar's own."""

    def record(self, key: Any, value: str, small: bool = False) -> None:
        pass

    def quotient(self, node: Node, name: str) -> None:
        pass

    def value(self, node: Node) -> str:
        if node.op == "const" and node.kind == "real":
            return str(int(node.data))
        return super().value(node)

    def numbers(self, constants: Constants) -> str:
        return self.scope.bound([int(v) for v in constants.numbers])

    def integral(self, node: Node, args: list[str]) -> str:
        if node.op == "segment":
            return self.evaluated(node, args)
        return super().integral(node, args)

    def operation(self, node: Node, args: list[str]) -> str:
        infix = {"add": "+", "sub": "-", "mul": "*"}.get(node.op)
        if infix:
            return f"({args[0]} {infix} {args[1]})"
        return f"(-{args[0]})" if node.op == "neg" else self.evaluated(node, args)

    def data(self, data: object) -> str:
        """What an operation holds beside its arguments."""
        return repr(data) if data is None or isinstance(data, tuple) else self.scope.bound(data)

    def evaluated(self, node: Node, args: list[str]) -> str:
        v = self.new(f"E({node.op!r}, {self.data(node.data)}, [{', '.join(args)}])")
        if saturates(node):
            self.emit(f"if not abs({v}) <= M.get({id(node)}, -1): M[{id(node)}] = abs({v})")
        return v


class IntegerProgram(RealProgram):
    """The functions of an integer filter on Python integers. peaks: see `certificate.certify`."""

    def __init__(self, functions: list[Function], arrays: Arrays, scalar: Fixed) -> None:
        self.scalar = scalar
        self.peaks: dict[int, int] = {}
        super().__init__(functions, arrays, Ranges(), _IntegerSource, {"E": scalar.evaluate, "M": self.peaks})
