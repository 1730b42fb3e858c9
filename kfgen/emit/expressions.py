"""The values of a program as C expressions, with no more parentheses than they need."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from kfgen.ir.nodes import Constants, Node, Table
from kfgen.scalars import Scalar

_COMPARE = {"lt": "<", "le": "<="}
# binding strength: what binds less tightly than its context asks stands in parentheses
TERNARY, _OR, _AND, _RELATION, SUM, _PRODUCT, _UNARY, _ATOM = range(8)


class Expressions:
    """Prints the expressions of one emitted function; `helpers` are the routines that those printed so far call.

    index_name(path, index) spells a constant index of an array (`VEHICLE_PX`), or returns None for the number.
    """

    def __init__(self, prefix: str, scalar: Scalar, index_name: Callable[[str, int], str | None],
                 tables: Mapping[Table | Constants, str]) -> None:  # fmt: skip
        self.prefix = prefix
        self.scalar = scalar
        self.index_name = index_name
        self.tables = tables
        self.status = "&flags"  # what a routine is given that may saturate
        self.helpers: set[str] = set()

    def expression(self, node: Node, context: int = TERNARY) -> str:
        if node.op == "variable":
            return str(node.data)
        text, strength = self._print(node)
        return f"({text})" if strength < context else text

    def _print(self, node: Node) -> tuple[str, int]:
        e = self.expression
        match node.op:
            case "sum":
                return self._sum(node)
            case "const":
                return self._constant(node)
            case "field":
                return self.path(node.data), _ATOM
            case "element" if node.kind == "int":  # a table of indices
                return f"{self.prefix.upper()}{node.data.removeprefix(self.prefix)}({e(node.args[0])})", _ATOM
            case "element":
                return f"{self.path(node.data)}[{self.index(node.data, node.args[0])}]", _ATOM
            case "read":
                return (f"{node.data}[{e(node.args[0])}]" if node.args else node.data), _ATOM
            case "variable" | "counter":
                return node.data, _ATOM
            case "real":
                return f"({self.scalar.c_type}){e(node.args[0], _ATOM)}", _UNARY
            case "lookup":
                return self._constant_at(self.tables[node.data], e(node.args[0])), _ATOM
            case "bit":
                path, place = node.data
                return f"({self.path(path)} & 0x{1 << place:x}u) != 0u", _RELATION
            case "half":
                return f"{e(node.args[0], _PRODUCT)} / 2", _PRODUCT
            case "slope":
                return self._constant_at(f"{self.tables[node.data]}_slope", e(node.args[0])), _ATOM
            case "table":
                name, i = self.tables[node.data], e(node.args[0])
                y, slope, x = (self._constant_at(f"{name}_{part}", i) for part in ("y", "slope", "x"))
                return f"{y} + {slope} * ({e(node.args[1])} - {x})", SUM
            case "add" if _counts(node.args[0]):  # a signed constant beside an unsigned count breaks MISRA C 10.4
                return f"{e(node.args[0], SUM)} + {e(node.args[1], _PRODUCT)}u", SUM
            case "add":
                return f"{e(node.args[0], SUM)} + {e(node.args[1], _PRODUCT)}", SUM
            case "sub":
                return f"{e(node.args[0], SUM)} - {e(node.args[1], _PRODUCT)}", SUM
            case "mul" if node.args[0].constant is not None and node.args[1].op == "mul":
                # c * (a * b) as a * b * c: the same value, without parentheses
                return f"{e(node.args[1], _PRODUCT)} * {e(node.args[0], _UNARY)}", _PRODUCT
            case "mul":
                return f"{e(node.args[0], _PRODUCT)} * {e(node.args[1], _UNARY)}", _PRODUCT
            case "div":
                return f"{e(node.args[0], _PRODUCT)} / {e(node.args[1], _UNARY)}", _PRODUCT
            case "neg":
                return f"-{e(node.args[0], _UNARY + 1)}", _UNARY
            case "lt" | "le":
                a, b = e(node.args[0], SUM), e(node.args[1], SUM)
                if node.args[0].constant is not None:  # read as x > 0, not 0 < x
                    return f"{b} {_COMPARE[node.op].replace('<', '>')} {a}", _RELATION
                return f"{a} {_COMPARE[node.op]} {b}{'u' if _counts(node.args[0]) else ''}", _RELATION
            case "signs":
                self.helpers.add("sign_bit")
                text = f"{self.prefix}_sign_bit({e(node.args[-1])})"
                return (text, _ATOM) if len(node.args) == 1 else (f"{e(node.args[0], _ATOM)} | {text}", _OR)
            case "some":
                return f"{e(node.args[0], _ATOM)} != 0u", _RELATION
            case "and":
                return f"{e(node.args[0], _AND)} && {e(node.args[1], _RELATION)}", _AND
            case "or":
                return f"{self._alternative(node.args[0])} || {self._alternative(node.args[1])}", _OR
            case "not":
                return f"!{e(node.args[0], _ATOM)}", _UNARY
            case "select":
                c, a, b = (e(x, _OR) for x in node.args)
                return f"{c} ? {a} : {b}", TERNARY
            case _:
                return self._call(node), _ATOM

    def _constant_at(self, array: str, index: str) -> str:
        """An entry of a constant array, which not every processor can read like others."""
        return f"{self.prefix.upper()}_at({array}, {index})"

    def _alternative(self, node: Node) -> str:
        """A side of ||: a chain of them as it is, && in parentheses for the reader's (and gcc's) sake."""
        return self.expression(node) if node.op == "or" else self.expression(node, _RELATION)

    def _constant(self, node: Node) -> tuple[str, int]:
        if node.kind == "bool":
            return ("true" if node.data else "false"), _ATOM
        text = str(int(node.data)) if node.kind == "int" else self.scalar.literal(node.data)
        return text, (_UNARY if text.startswith("-") else _ATOM)

    def _call(self, node: Node) -> str:
        args = [self.expression(a) for a in node.args]
        op = node.op
        if op.startswith("q_"):
            self.helpers.add(op)
            args += [str(d) if abs(d) < 2**31 else f"INT64_C({d})" for d in node.data or ()]
            args += [] if op in self.scalar.silent_ops else [self.status]
            return f"{self.prefix}_{op}({', '.join(args)})"
        if op.startswith("table_"):
            return self._constant_at(f"{self.tables[node.data]}{op.removeprefix('table')}", args[0])
        if op in self.scalar.helper_ops:
            self.helpers.add(op)
            if op == "wrap":
                args.append(self.scalar.literal(node.data / 2))
            elif op == "segment":
                args += [f"{self.tables[node.data]}_x", str(len(node.data.x))]
            return f"{self.prefix}_{op}({', '.join(args)})"
        return f"{self.scalar.function(op)}({', '.join(args)})"

    def _sum(self, node: Node) -> tuple[str, int]:
        text = ""
        position = 0
        for sign, count in node.data:
            factors = node.args[position : position + count]
            position += count
            if count == 2:
                term = f"{self.expression(factors[0], _PRODUCT)} * {self.expression(factors[1], _UNARY)}"
            else:
                term = self.expression(factors[0], _PRODUCT)
            if not text:
                if sign < 0:
                    term = f"-{self.expression(factors[0], _ATOM)}" + term[len(self.expression(factors[0], _PRODUCT)) :]
                text = term
            else:
                text += f" {'+' if sign > 0 else '-'} {term}"
        return text, SUM

    def path(self, path: str) -> str:
        return path.replace(".", "->", 1)

    def index(self, path: str, index: Node) -> str:
        if index.constant is not None:
            named = self.index_name(path, int(index.constant))
            return named if named is not None else str(int(index.constant))
        return self.expression(index)


def _counts(node: Node) -> bool:
    """Whether it is a counter in the struct, which is unsigned and meets nothing but constants."""
    return node.op == "field" and node.kind == "int" and str(node.data).startswith("kf.")
