"""The program as C statements. It decides spelling and layout, nothing of the algorithm."""

from __future__ import annotations

from kfgen.emit.expressions import SUM, Expressions
from kfgen.emit.lines import wrapped
from kfgen.emit.text import WIDTH, comment
from kfgen.ir.nodes import Node
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
from kfgen.ir.trace import RAISED


class Printer(Expressions):
    """Prints the statements of one emitted function."""

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
            case Let(node=node, name=name, point=point):
                kind = {"real": real, "bool": "bool", "int": "int", "bits": "uint32_t", "long": "int64_t"}[node.kind]
                return _noted(wrapped(f"const {kind} {name} = {e(node)};", depth), depth, point)
            case Declare(name=name, size=size, value=value, kind=kind, point=point):
                c_kind = real if kind == "real" else kind
                if size is not None:
                    return wrapped(f"{c_kind} {name}[{size}];", depth)
                assert value is not None
                return _noted(wrapped(f"{c_kind} {name} = {e(value)};", depth), depth, point)
            case Assign(name=name, index=index, node=node):
                target = name if index is None else f"{name}[{e(index)}]"
                return wrapped(f"{target} = {e(node)};", depth)
            case Store(name=name, index=index, node=node):
                target = self.path(name)
                if index is not None:
                    target += f"[{self.index(name, index)}]"
                return wrapped(f"{target} = {e(node)};", depth)
            case Guard(condition=condition, status=status, before=before, why=why):
                returned = status if status == RAISED else f"{self.prefix.upper()}_{status}"
                body = [line for store in before for line in self._statement(store, depth + 1)]
                if condition.constant is not None:  # known to hold
                    return [line[4:] for line in body] + ["    " * depth + f"return {returned};"]
                body += ["    " * (depth + 1) + f"return {returned};"]
                head = wrapped(f"if ({e(condition)}) {{" + (f" /* {why} */" if why else ""), depth)
                one_line = f"{head[0]} {body[0].strip()} }}"
                if len(body) == 1 and len(head) == 1 and not why and len(one_line) <= WIDTH:
                    return [one_line]
                return head + body + ["    " * depth + "}"]
            case Call(callee=callee, args=args):
                given = [self._argument(a) for a in args]
                told = "flags |= " if callee.returns == "status" else ""
                return wrapped(f"{told}{self.prefix}_{callee.name}({', '.join(given)});", depth)
            case Flag(condition=condition, flag=flag) if condition.constant is not None:
                return ["    " * depth + f"flags |= {self.prefix.upper()}_{flag};"]
            case Flag(condition=condition, flag=flag):
                return wrapped(f"if ({e(condition)}) {{ flags |= {self.prefix.upper()}_{flag}; }}", depth)
            case For(variable=v, start=start, stop=stop, body=inner, down=down):
                if down:
                    opening = f"for (int {v} = {e(stop, SUM)} - 1; {v} >= {e(start)}; {v}--) {{"
                else:
                    opening = f"for (int {v} = {e(start)}; {v} < {e(stop, SUM)}; {v}++) {{"
                return wrapped(opening, depth) + self.statements(inner, depth + 1) + ["    " * depth + "}"]
            case If(condition=condition, body=inner):
                opening = f"if ({e(condition)}) {{"
                return wrapped(opening, depth) + self.statements(inner, depth + 1) + ["    " * depth + "}"]

    def _argument(self, given: str | Slice | Node) -> str:
        if isinstance(given, str):
            return given
        if isinstance(given, Node):
            return self.expression(given)
        path = self.path(given.array)
        return path if given.offset.constant == 0 else f"&{path}[{self.expression(given.offset)}]"


def _noted(lines: list[str], depth: int, point: int | None) -> list[str]:
    """A declaration with the value of its raw 1: behind it, or above where there is no room."""
    if point is None:
        return lines
    note = f"/* 2^{point} */"
    if len(lines[-1]) + 1 + len(note) <= WIDTH:
        return [*lines[:-1], f"{lines[-1]} {note}"]
    return ["    " * depth + note, *lines]
