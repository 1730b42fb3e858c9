"""What the templates of a history see: a ring of states, and of what happened between them, around a filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from kfgen.emit.data import FunctionView, View
from kfgen.emit.text import with_unit
from kfgen.filters.base import FilterCode
from kfgen.scalars import Scalar

SETTERS = ("set_state", "set_covariance", "set_sqrt_covariance")


@dataclass(frozen=True)
class UpdateView:
    """An update of the filter. doc: what z holds."""

    name: str
    NAME: str
    sensor: str
    takes_u: bool
    takes_mask: bool
    doc: str


@dataclass(frozen=True)
class SetterView:
    """A function that replaces a part of the estimate by an array."""

    name: str
    argument: str
    size: int


@dataclass(frozen=True)
class HistoryView:
    """steps, per_step, keep: the spec's. kept: states in the ring, ring: steps in it. ram: bytes of the struct."""

    steps: int
    per_step: int
    keep: int
    kept: int
    ring: int
    ram: int
    predict_u: bool
    predict_dt: bool
    updates: tuple[UpdateView, ...]
    setters: tuple[SetterView, ...]
    inputs: str
    parameters: bool
    likelihood: bool  # whether the filter keeps its log-likelihood


def history_view(code: FilterCode, view: View, scalar: Scalar) -> HistoryView | None:
    """The history of a filter, where the spec asks for one."""
    spec = code.model.spec
    wanted = spec.history
    if wanted is None:
        return None
    public = {f.name: f for f in view.functions if not f.private}
    updates = [
        _update(function, sensor.name, ", ".join(with_unit(c.name, c.unit) for c in sensor.fields))
        for sensor in spec.measurements
        for function in (public.get(f"update_{sensor.name}"), public.get(f"update_{sensor.name}_masked"))
        if function is not None
    ]
    n = len(view.states)
    setters = tuple(
        SetterView(name, public[name].arguments[1], n if name == "set_state" else n * n)
        for name in SETTERS
        if name in public
    )
    # of as many whole groups of `keep` steps that the oldest state that a measurement may need is in the ring
    kept = -(-wanted.steps // wanted.keep) + 1
    found = HistoryView(
        wanted.steps, wanted.per_step, wanted.keep, kept, kept * wanted.keep, 0, "u" in public["predict"].arguments,
        "dt" in public["predict"].arguments, tuple(updates), setters,
        ", ".join(with_unit(i.name, i.unit) for i in spec.inputs), bool(spec.parameters),
        spec.code.log_likelihood,
    )  # fmt: skip
    return replace(found, ram=_ram(found, view, scalar))


def _update(function: FunctionView, sensor: str, doc: str) -> UpdateView:
    takes = function.arguments
    return UpdateView(function.name, function.name.upper(), sensor, "u" in takes, "mask" in takes, doc)


def _ram(h: HistoryView, view: View, scalar: Scalar) -> int:
    """The size of the struct: natural alignment, as `struct.ram` reckons."""
    real = scalar.size
    inputs = (real * len(view.inputs), real)
    sizes = {sensor.name: (real * len(sensor.fields), real) for sensor in view.sensors}
    given = [
        _struct([sizes[u.sensor], *([inputs] if u.takes_u else []), *([(4, 4)] if u.takes_mask else [])])
        for u in h.updates
    ]
    union_align = max(align for _, align in given)
    union = -(-max(size for size, _ in given) // union_align) * union_align
    size, align = _struct([(union, union_align), (1, 1)])
    step = [(size * h.per_step, align), *([inputs] if h.predict_u else []), *([(real, real)] if h.predict_dt else [])]
    step_size, step_align = _struct([*step, (1, 1)])
    own = max(4, real)  # a filter holds reals, and perhaps counters
    whole = [(view.ram * (1 + h.kept), own), (step_size * h.ring, step_align)]
    whole += [(real * (1 + h.likelihood), real), (8, 4)]
    return _struct(whole)[0]


def _struct(fields: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Size and alignment of a struct of fields of these."""
    size, align = 0, 1
    for bytes_, alignment in fields:
        size = -(-size // alignment) * alignment + bytes_
        align = max(align, alignment)
    return -(-size // align) * align, align
