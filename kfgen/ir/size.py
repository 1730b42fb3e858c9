"""How many bytes a function takes on a Cortex-M4F, told from its program: the one place that predicts flash."""

from __future__ import annotations

from kfgen.ir.nodes import Node
from kfgen.ir.program import Assign, Call, Declare, Flag, For, Function, Guard, If, Let, Statement, Store, roots

_ENTRY = 20  # of a function: what it saves, the tests of its pointers, its ends
_LOOP = 14  # counter, bounds, a jump
_BYTES = {"div": 8, "sqrt": 8, "abs": 4, "neg": 2, "lt": 8, "le": 8, "select": 6, "finite": 8, "wrap": 12}
_FREE = {"const", "variable", "counter", "and", "or", "not", "real", "half"}
_LIBRARY = 14  # a call of a function of libm, with what is kept over it
_SPILLS = 40000  # bytes of a function in which everything is spilled: long code has more values than registers


def predicted_flash(function: Function) -> int:
    """Bytes of .text and literals of a function in float, gcc -O2; private functions that it calls not included."""
    size = _Size()
    size.block(function.body)
    return round(_ENTRY + 4 * len(size.constants) + size.bytes * (1 + min(0.5, size.bytes / _SPILLS)))


class _Size:
    def __init__(self) -> None:
        self.bytes = 0.0
        self.constants: set[object] = set()

    def block(self, body: list[Statement]) -> None:
        for statement in body:
            for root in roots(statement):
                self.node(root)
            match statement:
                case Store() | Assign():
                    self.bytes += 4
                case Declare(size=None):
                    self.bytes += 4
                case Guard(before=before):
                    self.bytes += 6 + 4 * len(before)
                case Flag():
                    self.bytes += 8
                case Call(args=args):
                    self.bytes += 6 + 4 * len(args)
                case For(body=inner):
                    self.bytes += _LOOP
                    self.block(inner)
                case If(body=inner):
                    self.bytes += 6
                    self.block(inner)
                case Let() | _:
                    pass

    def node(self, node: Node) -> None:
        for argument in node.args:
            self.node(argument)
        if node.op == "const":
            if node.kind == "real" and node.data not in (0, 1, 2):
                self.constants.add(node.data)
        elif node.kind == "int":
            self.bytes += 1 if node.op in ("add", "sub", "mul", "element") else 0
        elif node.op == "sum":
            self.bytes += 4 * len(node.data)
        elif node.op in ("element", "field", "read", "lookup", "bit", "mul", "add", "sub"):
            self.bytes += 4
        elif node.op not in _FREE:
            self.bytes += _BYTES.get(node.op, _LIBRARY)
