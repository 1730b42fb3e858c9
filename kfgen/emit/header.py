"""The tables of the header: states, numbers with their units, what the filter is made of, constants."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from kfgen.emit.data import Data, Named
from kfgen.emit.text import WIDTH, about, columns, fill, safe
from kfgen.filters.base import FilterCode
from kfgen.ir.nodes import Constants, Table
from kfgen.scalars import Scalar
from kfgen.status import ERROR, Status

_REFERENCE_WIDTH = 88
_INDICES = {
    "order": "inner position -> index into x",
    "reach": "pair of columns of F U -> how many of its leading entries may differ from zero",
}


class Quantity(Protocol):
    """A number of the spec: a state, an input, a component of a measurement, a parameter."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def doc(self) -> str: ...


def members(quantities: Iterable[Quantity]) -> tuple[Named, ...]:
    """The members of a struct, comments in one column."""
    rows = [Named(q.name, about(q.unit, q.doc)) for q in quantities]
    width = max((len(r.name) for r in rows), default=0)
    return tuple(replace(r, comment=_behind(r.comment, width - len(r.name) + 1)) for r in rows)


def indices(prefix: str, states: Iterable[Quantity]) -> tuple[Named, ...]:
    """The enumerators of the states, comments in one column."""
    rows = [Named(s.name, about(s.unit, s.doc), index_name=f"{prefix}_{s.name.upper()}") for s in states]
    width = max(len(r.index_name) for r in rows)
    commas = [1] * (len(rows) - 1) + [0]
    return tuple(
        replace(r, comment=_behind(r.comment, width - len(r.index_name) + 2 - comma))
        for r, comma in zip(rows, commas, strict=True)
    )


def errors(prefix: str, code: FilterCode) -> tuple[Named, ...]:
    """The enumerators of the error coordinates, where they are not the states."""
    spec = code.model.spec
    if not spec.rotations:
        return ()
    sides = {"body": "in the body's frame", "reference": "in the reference frame"}
    rows = {s.name: Named(s.name, about(s.unit, s.doc)) for s in spec.states}
    for r in spec.rotations:
        rows |= {e: Named(e, about("rad", f"of {r.name}, {sides[r.error]}")) for e in r.errors}
    named = [replace(rows[e], index_name=f"{prefix}_ERROR_{e.upper()}") for e in spec.errors]
    width = max(len(r.index_name) for r in named)
    return tuple(
        replace(r, comment=_behind(r.comment, width - len(r.index_name) + 2 - (r is not named[-1]))) for r in named
    )


def _behind(comment: str, blanks: int) -> str:
    return " " * blanks + f"/* {comment} */" if comment else ""


def statuses() -> Iterator[Named]:
    """The bits of the status, and where the errors begin; TOO_OLD is one of the history's header."""
    for name, status in Status.__members__.items():
        if status == Status.TOO_OLD:
            continue
        if status == ERROR:
            yield _status("ERROR", ERROR, "errors from here up")
        yield _status(name, status, status.doc)


def _status(name: str, bit: int, doc: str) -> Named:
    return Named(name, _behind(doc, 1), value=f"0x{bit:03x}u")


def state_table(code: FilterCode) -> list[str]:
    """Name, unit, kind and doc of each state, in columns."""
    return columns([
        [s.name, f"[{safe(s.unit)}]" if s.unit else "", "" if s.kind == "real" else s.kind,
         safe(" ".join(s.doc.split()))]
        for s in code.model.spec.states
    ])  # fmt: skip


def cost_table(costs: Mapping[str, str]) -> list[str]:
    """The operations of each function that runs again and again."""
    return columns([[name, cost or "loops"] for name, cost in costs.items()])


def reference(code: FilterCode) -> Iterator[Data]:
    """The blocks of the header's comment that say what the filter is made of: inner orders, modes, the step."""
    names = code.model.spec.errors
    yield from _order("order of the states inside U and D", code.order, names)
    if code.modes:
        lines = [line for mode in code.modes for line in fill(f"{mode.name}: {mode.description}", _REFERENCE_WIDTH)]
        yield Data(title="modes", lines=tuple(lines))
    for mode in code.modes:
        yield from _order(f"order of the states inside U and D of {mode.name}", mode.order, names)
    yield Data(title=f"step: {_step(code)}")


def _order(title: str, order: Sequence[int], names: Sequence[str]) -> Iterator[Data]:
    """Told where it is not the spec's."""
    if tuple(order) != tuple(range(len(names))):
        yield Data(title=title, lines=tuple(fill(", ".join(names[i] for i in order), _REFERENCE_WIDTH)))


def _step(code: FilterCode) -> str:
    dt = code.model.spec.dt
    if dt is None:
        return "the model knows no time"
    if code.model.dt is not None:
        return f"{dt.nominal.text} s, compiled in"
    low, high = code.model.dt_limits
    limits = [f"{word} {float(v):g} s" for word, v in (("at least", low), ("at most", high)) if v is not None]
    return "given at each step" + (f", clamped to {', '.join(limits)}" if limits else "")


def index_tables(code: FilterCode) -> Iterator[Data]:
    """The constant tables of indices."""
    name = code.model.spec.name
    for key, values in code.constants.items():
        yield Data(
            name=f"{name}_{key}", reader=f"{name.upper()}_{key}", comment=_INDICES.get(key, _INDICES["order"]),
            size=len(values), lines=tuple(fill(", ".join(map(str, values)), WIDTH - 6)),
        )  # fmt: skip


def number_tables(code: FilterCode, scalar: Scalar, names: Mapping[Table | Constants, str]) -> Iterator[Data]:
    """The constant tables of numbers: those looked up as they stand, and piecewise linear functions."""
    arrays = [(names[lookup], lookup.numbers) for lookup in code.lookups]
    for table in code.tables:
        parts = (("x", table.starts()), ("y", table.values()), ("slope", table.slopes()))
        arrays += [(f"{names[table]}_{part}", values) for part, values in parts]
    for name, values in arrays:
        text = ", ".join(scalar.literal(v) for v in values)
        yield Data(name=name, size=len(values), lines=tuple(fill(text, WIDTH - 6)))
