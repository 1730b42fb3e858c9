"""What the templates see: frozen data, already spelled in C. No algorithm, no option logic."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version

import sympy

from kfgen.emit import struct
from kfgen.emit.printer import WIDTH, Printer, comment
from kfgen.filters.base import FilterCode
from kfgen.ir.count import operations
from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import Argument, Call, Flag, Function, Guard, roots, walk
from kfgen.ir.schedule import LIBRARY_NAMES
from kfgen.scalars import Scalar

STATUSES = (
    ("OK", 0x000, ""),
    ("REGULARIZED", 0x001, "a variance was limited, or taken to zero by round-off"),
    ("GLITCH_SMALL", 0x002, "an innovation was weighted down"),
    ("GLITCH_LARGE", 0x004, "an innovation was cut off"),
    ("ANOMALY", 0x008, "an innovation beyond its variance was taken all the same"),
    ("GATED", 0x010, "the measurement was refused; nothing but nis has changed"),
    ("SATURATED", 0x020, "a number was clipped to its range"),
    ("DT_CLAMPED", 0x040, "dt was outside of its limits and was clamped"),
    ("POINT_REJECTED", 0x080, "a sigma point was replaced"),
    ("ERROR", 0x100, "errors from here up"),
    ("NULL_ARGUMENT", 0x100, "a pointer is NULL"),
    ("NOT_FINITE", 0x200, "an argument or a value of the model is NaN or infinite"),
    ("NOT_POSITIVE", 0x400, "a variance or dt is not positive"),
)

_TABLES = {
    "order": "inner position -> index into x",
    "reach": "pair of columns of F U -> how many of its leading entries may differ from zero",
}
_QUIET = frozenset({"q_min", "q_max", "q_sign", "q_count", "q_fma", "q_abs"})
OWN = frozenset({"abs", "min", "max", "sign", "count", "fma", "fit", "mac"})
"""Routines of fixed point that stand in the template of the lowered program."""


@dataclass(frozen=True)
class Named:
    """A name with a comment, and whatever spelling belongs to it."""

    name: str
    comment: str = ""
    value: str = ""
    index_name: str = ""


@dataclass(frozen=True)
class SensorView:
    name: str
    NAME: str
    components: tuple[Named, ...]


@dataclass(frozen=True)
class Data:
    """A static const array, or a block of the header's comment."""

    name: str = ""
    title: str = ""
    comment: str = ""
    size: int = 0
    reader: str = ""  # the macro that reads an entry
    lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class FunctionView:
    doc: str
    comment: tuple[str, ...]  # the doc of a private function
    parameters: tuple[str, ...]
    returns: tuple[str, ...]
    costs: tuple[str, ...]
    prototype: tuple[str, ...]
    definition: tuple[str, ...]
    opening: tuple[str, ...]
    body: tuple[str, ...]
    closing: str
    private: bool


@dataclass(frozen=True)
class ScalarView:
    name: str
    fraction_bits: int | None  # fixed point only
    c_type: str
    helpers: str
    zero: str
    one: str
    ceil: str


@dataclass(frozen=True)
class View:
    name: str
    NAME: str
    guard: str
    command: str
    title: str
    description: tuple[str, ...]
    filter: str
    version: str
    sympy: str
    sha256: str
    ram: int
    scalar: ScalarView
    states: tuple[Named, ...]
    state_table: tuple[str, ...]
    reference: tuple[Data, ...]
    cost_table: tuple[str, ...]
    advice: tuple[str, ...]
    inputs: tuple[Named, ...]
    sensors: tuple[SensorView, ...]
    parameters: tuple[Named, ...]
    modes: tuple[struct.Struct, ...]
    fields: tuple[struct.Field, ...]
    statuses: tuple[Named, ...]
    functions: tuple[FunctionView, ...]
    constants: tuple[Data, ...]
    tables: tuple[Data, ...]
    helpers: tuple[str, ...]
    uses_math: bool
    units: tuple[Named, ...]  # fixed point: quantity -> the value of raw 1
    routines: Routines | None  # fixed point: what the routines are made of


def package_version() -> str:
    try:
        return version("kfgen")
    except PackageNotFoundError:
        return "0"


@dataclass(frozen=True)
class FixedPoint:
    """What the text of a fixed-point filter says beside its code.

    units: macro's name -> exponent of the value of raw 1. table: the report, in lines. floor: products round down.
    """

    fraction_bits: int
    units: tuple[tuple[str, int], ...]
    table: tuple[str, ...]
    floor: bool
    closure: Callable[[Iterable[str], bool], tuple[str, ...]]
    tables: object


@dataclass(frozen=True)
class Routines:
    """What the template of the integer routines is given."""

    ops: tuple[str, ...]
    own: tuple[str, ...]
    tables: object
    floor: bool


def make_view(code: FilterCode, scalar: Scalar, overridden: bool, fixed: FixedPoint | None = None) -> View:
    """The view of a filter; overridden: the scalar is not the spec's own."""
    return _ViewMaker(code, scalar, overridden, fixed).make()


class _ViewMaker:
    def __init__(self, code: FilterCode, scalar: Scalar, overridden: bool, fixed: FixedPoint | None = None) -> None:
        self.fixed = fixed
        self.code = code
        self.scalar = scalar
        self.overridden = overridden
        self.spec = code.model.spec
        self.name = self.spec.name
        self.NAME = self.name.upper()
        self.helpers: set[str] = set()
        labels: list[tuple[Table | Constants, str]] = [*code.tables.items(), *code.lookups.items()]
        self.tables = {table: f"{self.name}_{label}" for table, label in labels}

    def make(self) -> View:
        spec, code, scalar = self.spec, self.code, self.scalar
        functions = tuple(self.function(f) for f in code.functions)
        text = "\n".join(line for f in functions for line in f.body)
        names = [s.name for s in spec.states]
        description = [line for part in spec.description.strip().split("\n") for line in _fill(_safe(part), WIDTH - 4)]
        description = description if any(description) else []
        return View(
            name=self.name,
            NAME=self.NAME,
            guard=f"{self.NAME}_H_INCLUDED",
            command=f"{self.name}.yaml" + (f" --scalar {scalar.name}" if self.overridden else ""),
            title=description[0] if description else code.description,
            description=tuple(description[1:]),
            filter=code.description,
            version=package_version(),
            sympy=sympy.__version__,
            sha256=spec.sha256,
            ram=struct.ram(scalar, code.blocks, len(spec.parameters)),
            scalar=ScalarView(
                scalar.name, None if self.fixed is None else self.fixed.fraction_bits, scalar.c_type,
                scalar.helpers, scalar.literal(Fraction(0)), scalar.literal(Fraction(1)),
                scalar.function("ceil"),
            ),
            states=self.aligned([
                Named(s.name, _about(s.unit, s.doc), index_name=f"{self.NAME}_{s.name.upper()}") for s in spec.states
            ], "index_name", 1),
            state_table=tuple(_columns([
                [s.name, f"[{_safe(s.unit)}]" if s.unit else "", "" if s.kind == "real" else s.kind,
                 _safe(" ".join(s.doc.split()))]
                for s in spec.states
            ])),
            reference=tuple(self.reference(names)),
            cost_table=tuple(_columns([[f.name, self.cost(f) or "loops"] for f in code.functions if self.counted(f)])),
            advice=code.notes,
            inputs=self.aligned([Named(i.name, _about(i.unit, i.doc)) for i in spec.inputs], "name", 1),
            sensors=tuple(
                SensorView(s.name, s.name.upper(), self.aligned(
                    [Named(c.name, _about(c.unit, c.doc)) for c in s.components], "name", 1))
                for s in spec.measurements
            ),
            parameters=self.aligned([Named(p.name, _about(p.unit, p.doc)) for p in spec.parameters], "name", 1),
            modes=struct.modes(self.name, code.blocks),
            fields=struct.fields(self.name, code.blocks, bool(spec.parameters)),
            statuses=tuple(
                Named(name, f" /* {doc} */" if doc else "", value=f"0x{value:03x}u") for name, value, doc in STATUSES
            ),
            functions=functions,
            constants=tuple(
                Data(name=f"{self.name}_{key}", reader=f"{self.NAME}_{key}", comment=_TABLES.get(key, _TABLES["order"]),
                     size=len(values), lines=tuple(_fill(", ".join(map(str, values)), WIDTH - 6)))
                for key, values in code.constants.items()
            ),
            tables=tuple(self.table_data()),
            helpers=tuple(sorted(self.helpers)),
            units=self.units(),
            routines=self.routines(),
            uses_math=self.fixed is None
            and (bool(self.helpers & {"wrap"}) or any(f"{f}(" in text for f in LIBRARY_NAMES)),
        )  # fmt: skip

    # fixed point ---------------------------------------------------------------------------------------

    def units(self) -> tuple[Named, ...]:
        if self.fixed is None:
            return ()
        return tuple(Named(name, value=repr(2.0**e)) for name, e in self.fixed.units)

    def routines(self) -> Routines | None:
        if self.fixed is None:
            return None
        used = {op.removeprefix("q_") for op in self.helpers if op.startswith("q_")}
        used |= {"asr", "moved", "product", "round"} if used & {"fma", "mac"} else set()
        used |= {"fit"} if "mac" in used else set()
        own = tuple(sorted(used & OWN))
        return Routines(self.fixed.closure(used - OWN, self.fixed.floor), own, self.fixed.tables, self.fixed.floor)

    # header ------------------------------------------------------------------------------------------

    def aligned(self, rows: Sequence[Named], key: str, gap: int) -> tuple[Named, ...]:
        """Comments in one column."""
        width = max((len(getattr(r, key)) for r in rows), default=0)
        last = rows[-1] if rows else None
        out = []
        for r in rows:
            pad = " " * (width - len(getattr(r, key)) + gap + (1 if key == "index_name" and r is last else 0))
            out.append(Named(r.name, f"{pad}/* {r.comment} */" if r.comment else "", index_name=r.index_name))
        return tuple(out)

    def reference(self, names: list[str]) -> list[Data]:
        spec = self.spec
        out = []
        if self.code.order != tuple(range(len(names))):
            inner = ", ".join(names[i] for i in self.code.order)
            out.append(Data(title="order of the states inside U and D", lines=tuple(_fill(inner, 88))))
        if self.code.modes:
            lines = [line for mode in self.code.modes for line in _fill(f"{mode.name}: {mode.description}", 88)]
            out.append(Data(title="modes", lines=tuple(lines)))
        for mode in self.code.modes:
            if mode.order != tuple(range(len(names))):
                inner = ", ".join(names[i] for i in mode.order)
                title = f"order of the states inside U and D of {mode.name}"
                out.append(Data(title=title, lines=tuple(_fill(inner, 88))))
        if spec.dt is None:
            step = "the model knows no time"
        elif self.code.model.dt is not None:
            step = f"{spec.dt.nominal.text} s, compiled in"
        else:
            low, high = self.code.model.dt_limits
            limits = [f"{word} {float(v):g} s" for word, v in (("at least", low), ("at most", high)) if v is not None]
            step = "given at each step" + (f", clamped to {', '.join(limits)}" if limits else "")
        out.append(Data(title=f"step: {step}"))
        if self.fixed is not None:
            out.append(Data(title="", lines=()))
            out.append(Data(title="value of raw 1, range reckoned with, and bits above it", lines=self.fixed.table))
        return out

    def counted(self, function: Function) -> bool:
        return function.name == "predict" or function.name.startswith("update_")

    def cost(self, function: Function) -> str:
        counts = operations(function.body)
        if counts is None:
            return ""
        return ", ".join(f"{count} {op}" for op, count in counts.items()) or "none"

    # functions ---------------------------------------------------------------------------------------

    def index_name(self, path: str, index: int) -> str | None:
        if path == "x" or (path.startswith("kf.") and path.endswith(".x")):
            if index < len(self.spec.states):
                return f"{self.NAME}_{self.spec.states[index].name.upper()}"
        elif path == "kf.mu":
            return f"{self.NAME}_MODE_{self.code.modes[index].name.upper()}"
        return None

    def function(self, f: Function) -> FunctionView:
        has_flags = any(isinstance(s, Flag) for s in walk(f.body))
        saturates = self.fixed is not None and may_saturate(f)
        has_flags = has_flags or saturates
        printer = Printer(self.name, self.scalar, self.index_name, self.tables, has_flags)
        if f.private:
            printer.status = "flags"
        body = printer.statements(f.body)
        self.helpers |= printer.helpers
        void = f.returns == "void"
        head = f"{'static ' * f.private}{'void' if void else self.name + '_status_t'} {self.name}_{f.name}("
        arguments = [self.argument(a) for a in f.arguments]
        pointers = [a.name for a in f.arguments if a.pointer]
        test = " || ".join(f"{p} == NULL" for p in pointers)
        leave = "return;" if void else f"return {self.NAME}_NULL_ARGUMENT;"
        opening = [] if f.private else [f"if ({test}) {{ {leave} }}"]
        if has_flags and not f.private:
            opening.append(f"{self.name}_status_t flags = {self.NAME}_OK;")
        if body and body[0].lstrip().startswith("/*"):
            opening.append("")
        prototype = _signature(head, arguments)
        docs = {"u": ", ".join(_with_unit(i.name, i.unit) for i in self.spec.inputs)}
        sensor = f.name.removeprefix("update_")
        for s in self.spec.measurements:
            if s.name == sensor:
                docs["z"] = ", ".join(_with_unit(c.name, c.unit) for c in s.components)
        parameters = []
        width = max(len(a.name) for a in f.arguments)
        for a in f.arguments:
            lines = _fill(docs.get(a.name, a.doc), WIDTH - 14 - width)
            parameters.append(f"@param {a.name:<{width}}  {lines[0]}")
            parameters += [" " * (9 + width) + line for line in lines[1:]]
        returns = () if void else (f"@return {self.outcome(f)}",)
        cost = self.cost(f) if self.counted(f) else ""
        return FunctionView(
            doc=f.doc,
            comment=tuple(comment(f.doc)),
            parameters=tuple(parameters),
            returns=returns,
            costs=tuple(_fill(cost + ".", WIDTH - 6)) if cost else (),
            prototype=(*prototype[:-1], prototype[-1] + ";"),
            definition=tuple(prototype),
            opening=tuple(line.rstrip() for line in opening),
            body=tuple(body),
            private=f.private,
            closing="" if void else "return flags;" if has_flags else f"return {self.NAME}_OK;",
        )

    def outcome(self, f: Function) -> str:
        flags = sorted({s.flag for s in walk(f.body) if isinstance(s, Flag)})
        if self.fixed is not None and may_saturate(f):
            flags.append("SATURATED")
        flags += sorted({s.status for s in walk(f.body) if isinstance(s, Guard) and s.status == "GATED"})
        text = f"{self.NAME}_OK" + "".join(f", {self.NAME}_{flag}" for flag in flags)
        return (
            f"{text}, or an error that leaves *kf as it was"
            if f.name != "init"
            else f"{text}, or {self.NAME}_NULL_ARGUMENT"
        )

    def argument(self, a: Argument) -> str:
        kind = a.type.format(name=self.name)
        const = "const " if a.constant and a.pointer else ""
        if a.size is not None:
            return f"{const}{kind} {a.name}[{a.size}]"
        return f"{const}{kind} *{a.name}" if a.pointer else f"{kind} {a.name}"

    def table_data(self) -> list[Data]:
        out = []
        for lookup in self.code.lookups:
            text = ", ".join(self.scalar.literal(v) for v in lookup.numbers)
            lines = tuple(_fill(text, WIDTH - 6))
            out.append(Data(name=self.tables[lookup], size=len(lookup.numbers), lines=lines))
        for table in self.code.tables:
            name = self.tables[table]
            for suffix, values in (("x", table.starts()), ("y", table.values()), ("slope", table.slopes())):
                text = ", ".join(self.scalar.literal(v) for v in values)
                out.append(Data(name=f"{name}_{suffix}", size=len(values), lines=tuple(_fill(text, WIDTH - 6))))
        return out


def may_saturate(f: Function) -> bool:
    """Whether anything in a fixed-point function is given the status."""
    for s in walk(f.body):
        if isinstance(s, Call):
            return True
        stack = list(roots(s))
        while stack:
            node = stack.pop()
            if node.op.startswith("q_") and node.op not in _QUIET:
                return True
            stack += node.args
    return False


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


def _safe(text: str) -> str:
    """Free text of the spec, unable to end a comment or to start a trigraph."""
    return re.sub(r"\?(?=\?)", "? ", text.replace("*/", "* /").replace("/*", "/ *"))


def _about(unit: str, doc: str) -> str:
    unit, doc = _safe(unit), _safe(doc)
    return " ".join(part for part in (f"[{unit}]" if unit else "", " ".join(doc.split())) if part)


def _with_unit(name: str, unit: str) -> str:
    unit = _safe(unit)
    return f"{name} [{unit}]" if unit else name


def _fill(text: str, width: int) -> list[str]:
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _columns(rows: list[list[str]]) -> list[str]:
    if not rows:
        return []
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True) if w).rstrip() for row in rows]
