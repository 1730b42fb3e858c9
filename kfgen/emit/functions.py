"""An emitted function as the templates see it: what its comment says, its signature, its lines."""

from __future__ import annotations

import re
from collections.abc import Mapping

from kfgen.emit.data import FunctionView
from kfgen.emit.entries import Entry, with_entries
from kfgen.emit.fixed_point import may_saturate
from kfgen.emit.printer import Printer
from kfgen.emit.text import WIDTH, comment, fill, with_unit
from kfgen.filters.base import FilterCode
from kfgen.ir.count import operations
from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import Argument, Function, Guard, flags_of, walk
from kfgen.scalars import Scalar


class FunctionMaker:
    """Makes the views of a filter's functions; `helpers` are the routines that those made so far call, `costs` their
    operations.

    tables: their names in the C. fixed: the scalar is fixed point, whose operations may saturate.
    """

    def __init__(self, code: FilterCode, scalar: Scalar, tables: Mapping[Table | Constants, str], fixed: bool) -> None:
        self.code = code
        self.scalar = scalar
        self.tables = tables
        self.fixed = fixed
        self.spec = code.model.spec
        self.name = self.spec.name
        self.NAME = self.name.upper()
        self.helpers: set[str] = set()
        self.costs: dict[str, str] = {}  # of the functions that run again and again
        self.entries = {
            (f"kf.{b.name}", i): Entry(name, b.points[i] if b.points else None)
            for b in code.blocks
            for i, name in enumerate(b.entries)
        }
        self.taken = frozenset(f"{self.name}_{f.name}" for f in code.functions) | set(tables.values())

    def make(self, f: Function) -> FunctionView:
        saturates = self.fixed and may_saturate(f)
        has_flags = saturates or bool(flags_of(f.body))
        printer = Printer(self.name, self.scalar, self._index_name, self.tables)
        if f.private and f.returns == "void":
            printer.status = "flags"
        body = printer.statements(with_entries(f.body, self.entries, self.taken, self.name))
        self.helpers |= printer.helpers
        prototype = self._prototype(f)
        if _is_counted(f):
            self.costs[f.name] = _cost(f)
        cost = self.costs.get(f.name)
        return FunctionView(
            name=f.name,
            arguments=tuple(a.name for a in f.arguments),
            doc=f.doc,
            comment=tuple(comment(f.doc)),
            parameters=self._parameters(f),
            returns=() if f.returns == "void" else (f"@return {self._outcome(f, saturates)}",),
            costs=tuple(fill(cost + ".", WIDTH - 6)) if cost else (),
            prototype=(*prototype[:-1], prototype[-1] + ";"),
            definition=tuple(prototype),
            opening=self._opening(f, has_flags, body),
            body=tuple(body),
            private=f.private,
            closing="" if f.returns == "void" else "return flags;" if has_flags else f"return {self.NAME}_OK;",
        )

    def _index_name(self, path: str, index: int) -> str | None:
        if path == "x" or (path.startswith("kf.") and path.endswith(".x")):
            if index < len(self.spec.states):
                return f"{self.NAME}_{self.spec.states[index].name.upper()}"
        elif path == "kf.mu":
            return f"{self.NAME}_MODE_{self.code.modes[index].name.upper()}"
        return None

    def _prototype(self, f: Function) -> list[str]:
        kind = "void" if f.returns == "void" else self.name + "_status_t"
        head = f"{'static ' * f.private}{kind} {self.name}_{f.name}("
        return _signature(head, [self._argument(a) for a in f.arguments])

    def _argument(self, a: Argument) -> str:
        kind = a.type.format(name=self.name)
        const = "const " if a.constant and a.pointer else ""
        if a.size is not None:
            return f"{const}{kind} {a.name}[{a.size}]"
        return f"{const}{kind} *{a.name}" if a.pointer else f"{kind} {a.name}"

    def _opening(self, f: Function, has_flags: bool, body: list[str]) -> tuple[str, ...]:
        """The lines before the body: null pointers refused, the status declared."""
        test = " || ".join(f"{a.name} == NULL" for a in f.arguments if a.pointer)
        leave = "return;" if f.returns == "void" else f"return {self.NAME}_NULL_ARGUMENT;"
        opening = [] if f.private else [f"if ({test}) {{ {leave} }}"]
        if has_flags and f.returns == "status":
            opening.append(f"{self.name}_status_t flags = {self.NAME}_OK;")
        text = "\n".join(body)
        opening += [f"(void){a.name};" for a in f.arguments if f.private and not re.search(rf"\b{a.name}\b", text)]
        if body and body[0].lstrip().startswith("/*"):
            opening.append("")
        return tuple(opening)

    def _parameters(self, f: Function) -> tuple[str, ...]:
        docs = {"u": ", ".join(with_unit(i.name, i.unit) for i in self.spec.inputs)}
        sensor = f.name.removeprefix("update_")
        for s in self.spec.measurements:
            if s.name == sensor:
                docs["z"] = ", ".join(with_unit(c.name, c.unit) for c in s.components)
        out = []
        width = max(len(a.name) for a in f.arguments)
        for a in f.arguments:
            lines = fill(docs.get(a.name, a.doc), WIDTH - 14 - width)
            out.append(f"@param {a.name:<{width}}  {lines[0]}")
            out += [" " * (9 + width) + line for line in lines[1:]]
        return tuple(out)

    def _outcome(self, f: Function, saturates: bool) -> str:
        flags = sorted(flags_of(f.body))
        flags += ["SATURATED"] if saturates else []
        flags += sorted({s.status for s in walk(f.body) if isinstance(s, Guard) and s.status == "GATED"})
        text = f"{self.NAME}_OK" + "".join(f", {self.NAME}_{flag}" for flag in flags)
        if f.name == "init":
            return f"{text}, or {self.NAME}_NULL_ARGUMENT"
        return f"{text}, or an error that leaves *kf as it was"


def _is_counted(f: Function) -> bool:
    """Whether the operations of a function are told: of those that run again and again."""
    return f.name == "predict" or f.name.startswith("update_")


def _cost(f: Function) -> str:
    """`12 add, 3 mul`; empty where loops leave them uncounted."""
    counts = operations(f.body)
    if counts is None:
        return ""
    return ", ".join(f"{count} {op}" for op, count in counts.items()) or "none"


def _signature(head: str, arguments: list[str]) -> list[str]:
    line = head + ", ".join(arguments) + ")"
    if len(line) <= WIDTH - 1:
        return [line]
    ended = [a + "," for a in arguments[:-1]] + [arguments[-1] + ")"]
    pad = " " * len(head)
    lines = [head + ended[0], *(pad + a for a in ended[1:])]
    if max(map(len, lines)) < WIDTH:
        return lines
    kind, name = head.rsplit(" ", 1)
    return [*([head] if len(head) < WIDTH else [kind, name]), *("    " + a for a in ended)]
