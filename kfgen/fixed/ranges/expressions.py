"""Python source of expressions on floats: every operation a statement that records what it meets."""

from __future__ import annotations

from typing import Any

from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.program.nodes import grouped
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.scope import Scope
from kfgen.ir.nodes import Constants, Node
from kfgen.ir.program import Function


class ExpressionSource:
    """Writes the expressions of one function."""

    def __init__(self, function: Function, arrays: Arrays, ranges: Ranges, scope: Scope) -> None:
        self.f = function
        self.arrays = arrays
        self.ranges = ranges
        self.scope = scope
        self.lines: list[str] = []
        self.depth = 1
        self.count = 0
        self.private = {a.name for a in function.arguments if a.size is not None} if function.private else set()
        self.local: set[str] = set()

    def emit(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    def record(self, key: Any, value: str, small: bool = False) -> None:
        i = self.ranges.slot(key)
        self.emit(f"if H[{i}] < {value} < BIG: H[{i}] = {value}")
        self.emit(f"elif -BIG < {value} < L[{i}]: L[{i}] = {value}")
        if small:
            self.emit(f"if 0 < abs({value}) < S[{i}]: S[{i}] = abs({value})")

    def new(self, expression: str) -> str:
        self.count += 1
        self.emit(f"v{self.count} = {expression}")
        return f"v{self.count}"

    def array(self, name: str) -> tuple[str, str]:
        """The Python list of an array, and the offset of a slice."""
        if name in self.private:
            return f"a_{name}", f"o_{name}"
        if name in self.local:
            return f"l_{name}", ""
        return f"A[{name!r}]", ""

    def place(self, name: str, index: Node) -> str:
        array, offset = self.array(name)
        at = self.value(index)
        return f"{array}[{offset} + {at}]" if offset else f"{array}[{at}]"

    def numbers(self, constants: Constants) -> str:
        """A table of constants."""
        return self.scope.bound([float(v) for v in constants.numbers])

    def value(self, node: Node) -> str:
        """A Python expression: a name or a number; what is computed has been emitted."""
        match node.op:
            case "const":
                if node.kind == "real":
                    return repr(float(node.data))
                return repr(bool(node.data)) if node.kind == "bool" else str(int(node.data))
            case "variable":
                return f"l_{node.data}"
            case "counter":
                return f"c_{node.data}"
            case "field":
                if self.f.private and not node.data.startswith(("kf.", "u.", "z.")):
                    return f"n_{node.data}"
                return f"N[{node.data!r}]"
            case "element":
                return self.place(node.data, node.args[0])
            case "read":
                return self.place(node.data, node.args[0]) if node.args else self.new(f"l_{node.data}")
            case "real":
                return f"float({self.value(node.args[0])})"
            case "lookup":
                return f"{self.numbers(node.data)}[{self.value(node.args[0])}]"
            case "bit":
                path, place = node.data
                return f"bool(N[{path!r}] >> {place} & 1)"
            case "present":
                return "True"
            case "finite":
                v = self.value(node.args[0])
                return f"(-inf < {v} < inf)"
            case "not":
                return f"(not {self.value(node.args[0])})"
            case "and" | "or":
                return self.shortcut(node)
            case "select":
                return self.select(node)
        args = [self.value(a) for a in node.args]
        if node.kind == "int":
            return self.integral(node, args)
        if node.op in ("lt", "le"):
            return f"({args[0]} {'<' if node.op == 'lt' else '<='} {args[1]})"
        return self.operation(node, args)

    def integral(self, node: Node, args: list[str]) -> str:
        if node.op == "segment":
            return self.new(f"segment({args[0]}, {self.scope.table(node.data)}_x)")
        if node.op == "half":
            return f"({args[0]} // 2)"
        if node.op == "neg":
            return f"(-{args[0]})"
        return f"({args[0]} { {'add': '+', 'sub': '-', 'mul': '*'}[node.op] } {args[1]})"

    def shortcut(self, node: Node) -> str:
        self.count += 1
        name = f"v{self.count}"
        self.emit(f"{name} = {self.value(node.args[0])}")
        self.emit(f"if {'not ' if node.op == 'or' else ''}{name}:")
        self.depth += 1
        self.emit(f"{name} = {self.value(node.args[1])}")
        self.depth -= 1
        return name

    def select(self, node: Node) -> str:
        self.count += 1
        name = f"v{self.count}"
        for head, branch in ((f"if {self.value(node.args[0])}:", node.args[1]), ("else:", node.args[2])):
            self.emit(head)
            self.depth += 1
            self.emit(f"{name} = {self.value(branch)}")
            self.depth -= 1
        if node.kind == "real":
            self.record(node, name)
        return name

    def operation(self, node: Node, args: list[str]) -> str:
        op = node.op
        if op == "sum":
            total = ""
            for sign, factors in grouped(node.data, args):
                term = factors[0] if len(factors) == 1 else self.new(f"{factors[0]} * {factors[1]}")
                if not term.isidentifier():
                    term = self.new(term)
                self.record(node, term)
                total = self.new(f"{total} {'+' if sign > 0 else '-'} {term}" if total else
                                 (term if sign > 0 else f"-{term}"))  # fmt: skip
                self.record(node, total)
            i = self.ranges.slot(("result", node))
            self.emit(f"if 0 < abs({total}) < S[{i}]: S[{i}] = abs({total})")
            self.record(("result", node), total)
            return total
        infix = {"add": "+", "sub": "-", "mul": "*"}.get(op)
        if infix:
            v = self.new(f"{args[0]} {infix} {args[1]}")
            if op != "mul":
                for a in args:
                    if not a.isidentifier():
                        a = self.new(a)
                    self.record(node, a)
        elif op == "neg":
            v = self.new(f"-{args[0]}")
        elif op == "wrap":
            v = self.new(f"wrap({args[0]}, {float(node.data)!r})")
        elif op == "table":
            t = self.scope.table(node.data)
            v = self.new(f"{t}_y[{args[0]}] + {t}_d[{args[0]}] * ({args[1]} - {t}_s[{args[0]}])")
        elif op == "slope":
            v = self.new(f"{self.scope.table(node.data)}_d[{args[0]}]")
        else:
            v = self.new(f"q_{op}({', '.join(args)})")
        self.record(node, v, small=op in ("div", "mul", "sqrt"))
        return v
