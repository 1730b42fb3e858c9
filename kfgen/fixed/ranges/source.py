"""The Python source of a function on floats: every operation a statement that records what it meets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kfgen.fixed.program.cells import Cell, array_of, number_of
from kfgen.ir.nodes import Node
from kfgen.ir.program import (
    Assign,
    Call,
    Declare,
    Flag,
    For,
    Function,
    Guard,
    If,
    Let,
    Section,
    Slice,
    Statement,
    Store,
)  # fmt: skip

if TYPE_CHECKING:
    from kfgen.fixed.ranges.real import RealProgram


def unguarded(node: Node) -> Node:
    """What a choice takes where its condition holds, if it takes 0 otherwise."""
    while node.op == "select" and node.args[2].constant == 0:
        node = node.args[1]
    return node


class Source:
    """Writes one function; a subclass may say otherwise how numbers are computed."""

    def __init__(self, function: Function, program: RealProgram) -> None:
        self.f = function
        self.program = program
        self.ranges = program.ranges
        self.lines: list[str] = []
        self.depth = 1
        self.count = 0
        self.private = {a.name for a in function.arguments if a.size is not None} if function.private else set()
        self.local: set[str] = set()
        self.inverses: set[str] = set()  # locals that are 1/x

    def text(self) -> str:
        if self.f.private:
            args = []
            for a in self.f.arguments:
                args += [f"a_{a.name}", f"o_{a.name}"] if a.size is not None else [f"n_{a.name}"]
            self.lines.append(f"def f_{self.f.name}(A, N, {', '.join(args)}):")
        else:
            self.lines.append(f"def f_{self.f.name}(A, N):")
        self.block(self.f.body)
        self.emit("return 'OK'")
        return "\n".join(self.lines) + "\n"

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

    # statements --------------------------------------------------------------------------------------

    def block(self, body: list[Statement]) -> None:
        for s in body:
            self.statement(s)

    def nested(self, head: str, body: list[Statement]) -> None:
        self.emit(head)
        self.depth += 1
        self.block(body)
        self.emit("pass")
        self.depth -= 1

    def statement(self, s: Statement) -> None:
        match s:
            case Section():
                return
            case Let(node=node, name=name):
                self.emit(f"l_{name} = {self.value(node)}")
                self.quotient(node, name)
            case Declare(name=name, size=size, value=value):
                self.local.add(name)
                if size is not None:
                    self.emit(f"l_{name} = [0.0] * {size}")
                elif value is not None:
                    v = self.value(value)
                    self.emit(f"l_{name} = {v}")
                    if value.kind == "real":
                        self.record(("variable", self.f.name, name), f"l_{name}")
            case Assign(name=name, index=None, node=node):
                self.emit(f"l_{name} = {self.value(node)}")
                if node.kind == "real":
                    self.record(("variable", self.f.name, name), f"l_{name}")
            case Assign() | Store():
                self.store(s)
            case Guard(condition=condition, status=status, before=before):
                c = self.value(condition)
                self.emit(f"if {c}:")
                self.depth += 1
                for inner in before:
                    self.store(inner)
                self.emit(f"return {status!r}")
                self.depth -= 1
            case Flag(condition=condition):
                self.value(condition)
            case If(condition=condition, body=body):
                self.nested(f"if {self.value(condition)}:", body)
            case For(variable=v, start=start, stop=stop, body=body, down=down):
                a, b = self.value(start), self.value(stop)
                span = f"range({b} - 1, {a} - 1, -1)" if down else f"range({a}, {b})"
                self.nested(f"for c_{v} in {span}:", body)
            case Call():
                self.call(s)

    def quotient(self, node: Node, name: str) -> None:
        """Keep the values of a local that is a quotient."""
        node = unguarded(node)
        if node.op == "div" and node.args[0].constant is not None:
            self.inverses.add(name)
        elif node.op == "div" or (node.op == "mul" and any(a.data in self.inverses for a in node.args)):
            values = self.ranges.quotients.setdefault((self.f.name, name), [])
            self.emit(f"{self.program.bound(values)}.append(l_{name})")

    def call(self, s: Call) -> None:
        args = []
        for argument, given in zip(s.callee.arguments, s.args, strict=True):
            if isinstance(given, Slice):
                array, offset = self.array(given.array)
                args += [array, f"{offset} + {self.value(given.offset)}" if offset else self.value(given.offset)]
            elif isinstance(given, Node):
                v = self.value(given)
                self.record(number_of(s.callee, argument.name), v)
                args.append(v)
            else:
                args.append("None")
        self.emit(f"f_{s.callee.name}({', '.join(['A', 'N', *args])})")

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

    def store(self, s: Assign | Store) -> None:
        v = self.value(s.node)
        if s.index is None:
            self.emit(f"N[{s.name!r}] = {v}")
            if s.node.kind == "real":
                self.record(number_of(self.f, s.name), v)
            return
        self.emit(f"{self.place(s.name, s.index)} = {v}")
        if s.node.kind == "real":
            v = self.new(v) if not v.isidentifier() else v
            self.record(self.cell(s.name, s.index), v, small=s.name == "P")

    def cell(self, name: str, index: Node) -> Cell:
        from kfgen.fixed.program.cells import affine

        return self.program.arrays.element(array_of(self.f, name), affine(index)[0])

    # values ------------------------------------------------------------------------------------------

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
                if self.f.private and not node.data.startswith(("kf.", "u.")):
                    return f"n_{node.data}"
                return f"N[{node.data!r}]"
            case "element":
                return self.place(node.data, node.args[0])
            case "read":
                return self.place(node.data, node.args[0]) if node.args else self.new(f"l_{node.data}")
            case "real":
                return f"float({self.value(node.args[0])})"
            case "lookup":
                return f"{self.program.constants(node.data.numbers)}[{self.value(node.args[0])}]"
            case "bit":
                path, place = node.data
                return f"bool(N[{path!r}] >> {place} & 1)"
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
            return self.new(f"segment({args[0]}, {self.program.table(node.data)}_x)")
        if node.op == "half":
            return f"({args[0]} // 2)"
        if node.op == "neg":
            return f"(-{args[0]})"
        return f"({args[0]} { {'add': '+', 'sub': '-', 'mul': '*'}[node.op]} {args[1]})"

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
            total, position = "", 0
            for sign, count in node.data:
                term = args[position] if count == 1 else self.new(f"{args[position]} * {args[position + 1]}")
                position += count
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
            t = self.program.table(node.data)
            v = self.new(f"{t}_y[{args[0]}] + {t}_d[{args[0]}] * ({args[1]} - {t}_s[{args[0]}])")
        elif op == "slope":
            v = self.new(f"{self.program.table(node.data)}_d[{args[0]}]")
        else:
            v = self.new(f"q_{op}({', '.join(args)})")
        self.record(node, v, small=op in ("div", "mul", "sqrt"))
        return v
