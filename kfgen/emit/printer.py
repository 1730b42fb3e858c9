"""The program as C statements. It decides spelling and layout, nothing of the algorithm."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from kfgen.emit.text import WIDTH, comment
from kfgen.ir.nodes import Constants, Node, Table
from kfgen.ir.program import (
    Assign,
    Call,
    Declare,
    Flag,
    For,
    Guard,
    If,
    Let,
    Section,
    Slice,
    Statement,
    Store,
)  # fmt: skip
from kfgen.scalars import Scalar

_COMPARE = {"lt": "<", "le": "<="}
# binding strength: what binds less tightly than its context asks stands in parentheses
_TERNARY, _OR, _AND, _RELATION, _SUM, _PRODUCT, _UNARY, _ATOM = range(8)


class Printer:
    """Prints the statements of one emitted function.

    index_name(path, index) spells a constant index of an array (`VEHICLE_PX`), or returns None for the number.
    """

    def __init__(self, prefix: str, scalar: Scalar, index_name: Callable[[str, int], str | None],
                 tables: Mapping[Table | Constants, str], has_flags: bool = False) -> None:  # fmt: skip
        self.prefix = prefix
        self.scalar = scalar
        self.index_name = index_name
        self.tables = tables
        self.has_flags = has_flags
        self.status = "&flags"  # what a routine is given that may saturate
        self.helpers: set[str] = set()

    # expressions -------------------------------------------------------------------------------------

    def expression(self, node: Node, context: int = _TERNARY) -> str:
        text, strength = self._print(node)
        return f"({text})" if strength < context else text

    def _print(self, node: Node) -> tuple[str, int]:
        e = self.expression
        match node.op:
            case "const":
                return self._constant(node)
            case "field":
                return self._path(node.data), _ATOM
            case "element" if node.kind == "int":  # a table of indices
                return f"{self.prefix.upper()}{node.data.removeprefix(self.prefix)}({e(node.args[0])})", _ATOM
            case "element":
                return f"{self._path(node.data)}[{self._index(node.data, node.args[0])}]", _ATOM
            case "read":
                return (f"{node.data}[{e(node.args[0])}]" if node.args else node.data), _ATOM
            case "variable" | "counter":
                return node.data, _ATOM
            case "sum":
                return self._sum(node)
            case "real":
                return f"({self.scalar.c_type}){e(node.args[0], _ATOM)}", _UNARY
            case "lookup":
                return self._constant_at(self.tables[node.data], e(node.args[0])), _ATOM
            case "bit":
                path, place = node.data
                return f"({self._path(path)} & 0x{1 << place:x}u) != 0u", _RELATION
            case "half":
                return f"{e(node.args[0], _PRODUCT)} / 2", _PRODUCT
            case "slope":
                return self._constant_at(f"{self.tables[node.data]}_slope", e(node.args[0])), _ATOM
            case "table":
                name, i = self.tables[node.data], e(node.args[0])
                y, slope, x = (self._constant_at(f"{name}_{part}", i) for part in ("y", "slope", "x"))
                return f"{y} + {slope} * ({e(node.args[1])} - {x})", _SUM
            case "add":
                return f"{e(node.args[0], _SUM)} + {e(node.args[1], _PRODUCT)}", _SUM
            case "sub":
                return f"{e(node.args[0], _SUM)} - {e(node.args[1], _PRODUCT)}", _SUM
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
                a, b = e(node.args[0], _SUM), e(node.args[1], _SUM)
                if node.args[0].constant is not None:  # read as x > 0, not 0 < x
                    return f"{b} {_COMPARE[node.op].replace('<', '>')} {a}", _RELATION
                return f"{a} {_COMPARE[node.op]} {b}", _RELATION
            case "and":
                return f"{e(node.args[0], _AND)} && {e(node.args[1], _RELATION)}", _AND
            case "or":
                return f"{self._alternative(node.args[0])} || {self._alternative(node.args[1])}", _OR
            case "not":
                return f"!{e(node.args[0], _ATOM)}", _UNARY
            case "select":
                c, a, b = (e(x, _OR) for x in node.args)
                return f"{c} ? {a} : {b}", _TERNARY
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
        return text, _SUM

    def _path(self, path: str) -> str:
        return path.replace(".", "->", 1)

    def _index(self, path: str, index: Node) -> str:
        if index.constant is not None:
            named = self.index_name(path, int(index.constant))
            return named if named is not None else str(int(index.constant))
        return self.expression(index)

    def _argument(self, given: str | Slice | Node) -> str:
        if isinstance(given, str):
            return given
        if isinstance(given, Node):
            return self.expression(given)
        path = self._path(given.array)
        return path if given.offset.constant == 0 else f"&{path}[{self.expression(given.offset)}]"

    # statements --------------------------------------------------------------------------------------

    def statements(self, body: list[Statement], depth: int = 1) -> list[str]:
        """The lines of a function's body, indented."""
        out: list[str] = []
        for statement in body:
            if isinstance(statement, Section) and out:
                out.append("")
            out += self._statement(statement, depth)
        return out

    def _statement(self, statement: Statement, depth: int) -> list[str]:
        e = self.expression
        real = self.scalar.c_type
        match statement:
            case Section(text=text):
                return comment(text, depth)
            case Let(node=node, name=name):
                kind = {"real": real, "bool": "bool", "int": "int", "long": "int64_t"}[node.kind]
                return _wrapped(f"const {kind} {name} = {e(node)};", depth)
            case Declare(name=name, size=size, value=value, kind=kind):
                c_kind = real if kind == "real" else kind
                if size is not None:
                    return _wrapped(f"{c_kind} {name}[{size}];", depth)
                assert value is not None
                return _wrapped(f"{c_kind} {name} = {e(value)};", depth)
            case Assign(name=name, index=index, node=node):
                target = name if index is None else f"{name}[{e(index)}]"
                return _wrapped(_assignment(target, e(node)), depth)
            case Store(name=name, index=index, node=node):
                target = name.replace(".", "->", 1)
                if index is not None:
                    target += f"[{self._index(name, index)}]"
                return _wrapped(_assignment(target, e(node)), depth)
            case Guard(condition=condition, status=status, before=before, why=why):
                returned = f"{self.prefix.upper()}_{status}"
                body = [line for store in before for line in self._statement(store, depth + 1)]
                body += ["    " * (depth + 1) + f"return {returned};"]
                head = _wrapped(f"if ({e(condition)}) {{" + (f" /* {why} */" if why else ""), depth)
                one_line = f"{head[0]} {body[0].strip()} }}"
                if len(body) == 1 and len(head) == 1 and not why and len(one_line) <= WIDTH:
                    return [one_line]
                return head + body + ["    " * depth + "}"]
            case Call(callee=callee, args=args):
                given = [self._argument(a) for a in args]
                return _wrapped(f"{self.prefix}_{callee.name}({', '.join(given)});", depth)
            case Flag(condition=condition, flag=flag) if condition.constant is not None:
                return ["    " * depth + f"flags |= {self.prefix.upper()}_{flag};"]
            case Flag(condition=condition, flag=flag):
                return _wrapped(f"if ({e(condition)}) {{ flags |= {self.prefix.upper()}_{flag}; }}", depth)
            case For(variable=v, start=start, stop=stop, body=inner, down=down):
                if down:
                    opening = f"for (int {v} = {e(stop, _SUM)} - 1; {v} >= {e(start)}; {v}--) {{"
                else:
                    opening = f"for (int {v} = {e(start)}; {v} < {e(stop, _SUM)}; {v}++) {{"
                return _wrapped(opening, depth) + self.statements(inner, depth + 1) + ["    " * depth + "}"]
            case If(condition=condition, body=inner):
                opening = f"if ({e(condition)}) {{"
                return _wrapped(opening, depth) + self.statements(inner, depth + 1) + ["    " * depth + "}"]


def _assignment(target: str, value: str) -> str:
    return f"{target} = {value};"


def _wrapped(text: str, depth: int) -> list[str]:
    """A statement in lines of at most WIDTH columns, broken before the outermost operator that fits."""
    indent = "    " * depth
    lines: list[str] = []
    rest = indent + text
    while len(rest) > WIDTH:
        cut = _break(rest, len(indent) + (4 if lines else 0))
        if cut is None:
            break
        lines.append(rest[:cut].rstrip())
        rest = indent + "    " + rest[cut:].lstrip()
    return [*lines, rest]


def _break(text: str, start: int) -> int | None:
    """Where to break a line: at the space of least parenthesis depth in the last two thirds, the last of those.

    Where there is none, at the last one before, or else behind a parenthesis.
    """
    best: tuple[int, int] | None = None
    early: int | None = None
    opened: int | None = None
    level = 0
    in_product = 0
    for i, c in enumerate(text[: WIDTH + 1]):
        if c in "([":
            level += 1
            opened = i + 1 if c == "(" and start < i < WIDTH - 1 else opened
        elif c in ")]":
            level -= 1
        elif c == " " and i > start:
            following = text[i + 1 : i + 2]
            if following in "+-?:|&" or text[i - 1] in ",=":
                in_product = 0
            elif following in "*/":
                in_product = 1
            else:
                continue
            if i <= start + (WIDTH - start) // 3:
                early = i
                continue
            score = -(2 * level + in_product)
            if best is None or score >= best[0]:
                best = (score, i)
    return best[1] if best is not None else opened if early is None else early
