"""The real program as Python functions on floats that record the largest values met: where binary points come from.

Every operation is a statement of generated Python source, so that a run of a few hundred steps takes a fraction of
a second. The source is made of the program alone; no text of a spec enters it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from kfgen.fixed.cells import Arrays, Cell, array_of, number_of
from kfgen.ir.nodes import Node, Table
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

HUGE = 1e30  # what is beyond has left the model


@dataclass
class Ranges:
    """high, low: the largest and smallest value (at least 0, at most 0); small: the smallest size that is not 0."""

    index: dict[Any, int] = field(default_factory=dict)
    high: list[float] = field(default_factory=list)
    low: list[float] = field(default_factory=list)
    small: list[float] = field(default_factory=list)

    def slot(self, key: Any) -> int:
        """The place of a cell or of a node."""
        found = self.index.get(key)
        if found is None:
            found = self.index[key] = len(self.high)
            self.high.append(0.0)
            self.low.append(0.0)
            self.small.append(HUGE)
        return found

    def see(self, key: Any, value: float) -> None:
        i = self.slot(key)
        if math.isfinite(value):
            self.high[i] = max(self.high[i], value)
            self.low[i] = min(self.low[i], value)

    def largest(self, key: Any) -> float:
        """The largest size met, 0 where nothing was."""
        i = self.index.get(key)
        return 0.0 if i is None else max(self.high[i], -self.low[i])

    def smallest(self, key: Any) -> float:
        i = self.index.get(key)
        return 0.0 if i is None or self.small[i] >= HUGE else self.small[i]


@dataclass
class Memory:
    """What functions work on: `kf.x` -> list; `kf.nis`, `u.gyro`, `z.x`, `dt` -> number."""

    arrays: dict[str, list[Any]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> Memory:
        return Memory({k: list(v) for k, v in self.arrays.items()}, dict(self.numbers))


class RealProgram:
    """The functions of a filter, to be run on a Memory."""

    def __init__(self, functions: list[Function], arrays: Arrays, ranges: Ranges,
                 source: type[Source] | None = None, scope: dict[str, Any] | None = None) -> None:  # fmt: skip
        self.ranges = ranges
        self.arrays = arrays
        self._scope: dict[str, Any] = {
            **_FUNCTIONS, "H": ranges.high, "L": ranges.low, "S": ranges.small, "BIG": HUGE, "inf": math.inf,
            **(scope or {}),
        }  # fmt: skip
        for f in functions:
            text = (source or Source)(f, self).text()
            exec(compile(text, f"<{f.name}>", "exec"), self._scope)

    def table(self, table: Table) -> str:
        name = f"table_{len(self._scope)}"
        for known, value in self._scope.items():
            if value is table:
                return known
        self._scope[name] = table
        self._scope[f"{name}_x"] = [float(v) for v in table.x]
        self._scope[f"{name}_s"] = [float(v) for v in table.starts()]
        self._scope[f"{name}_y"] = [float(v) for v in table.values()]
        self._scope[f"{name}_d"] = [float(v) for v in table.slopes()]
        return name

    def bound(self, value: object) -> str:
        """A name for an object, as the source may use it."""
        name = f"bound_{len(self._scope)}"
        self._scope[name] = value
        return name

    def constants(self, numbers: tuple[Any, ...]) -> str:
        return self.bound([float(v) for v in numbers])

    def data(self, data: object) -> str:
        """What an operation holds beside its arguments, as the source may use it."""
        return self.bound(data)

    def numbers(self, numbers: tuple[Any, ...]) -> str:
        """A table of constants."""
        return self.constants(numbers)

    def run(self, function: str, memory: Memory) -> str:
        """Run a function; the name of the status with which it ended."""
        result: str = self._scope[f"f_{function}"](memory.arrays, memory.numbers)
        return result


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
        from kfgen.fixed.cells import affine

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


def _safe(function: Callable[..., float]) -> Callable[..., float]:
    def call(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError, ZeroDivisionError):
            return math.nan

    return call


def _div(a: float, b: float) -> float:
    if b == 0:
        return math.nan if a == 0 or a != a else math.copysign(math.inf, a)
    return a / b


def _wrap(a: float, period: float) -> float:
    half = period / 2
    if math.isfinite(a) and (a > half or a <= -half):
        a -= period * math.ceil((a - half) / period)
    return a


def _segment(a: float, points: list[float]) -> int:
    return sum(1 for p in points if p <= a)


_FUNCTIONS: dict[str, Any] = {
    "q_div": _div,
    "wrap": _wrap,
    "segment": _segment,
    "q_abs": abs,
    "q_min": lambda a, b: b if b < a else a,
    "q_max": lambda a, b: b if b > a else a,
    "q_sign": lambda a: float((a > 0) - (a < 0)),
    "q_floor": _safe(lambda a: float(math.floor(a))),
    "q_pow": _safe(lambda a, b: float(math.pow(a, b))),
    **{f"q_{name}": _safe(getattr(math, name)) for name in (
        "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "atan2")},
}  # fmt: skip
