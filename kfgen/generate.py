"""From a spec to its C files, and what they cost. Pure: the same bytes for the same spec, options and versions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from kfgen.budgets import Prediction, exceeded, predict
from kfgen.emit.data import View
from kfgen.emit.declarations import Declarations, declarations
from kfgen.emit.history import HistoryView, history_view
from kfgen.emit.render import render, render_history
from kfgen.emit.view import make_view
from kfgen.errors import KfgenError, SpecError
from kfgen.filters.base import FilterCode
from kfgen.filters.build import build_filter
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.build import FixedFilter, build_fixed
from kfgen.fixed.substeps import limit_substeps
from kfgen.ir.count import operations
from kfgen.ir.names import RESERVED
from kfgen.logs import Log, read
from kfgen.scalars import SCALARS, Scalar
from kfgen.seal import sealed
from kfgen.spec.types import Spec

UNROLLED = "no loops in fixed point: an element of a covariance has a binary point of its own, and its own code"


@dataclass(frozen=True)
class Summary:
    """What the build table shows: operations per function, RAM in bytes, remarks, flash and stack as predicted,
    loops or unrolled, where chosen."""

    rows: list[tuple[str, dict[str, int]]]
    ram: int
    notes: list[str]
    prediction: Prediction
    forms: Mapping[str, str]


@dataclass(frozen=True)
class Generated:
    """The files of a filter, and the program they were printed from. real: the program before it was lowered to
    integers; told: further remarks."""

    files: dict[str, str]
    code: FilterCode
    view: View
    scalar: Scalar
    real: FilterCode
    told: Sequence[str] = ()
    fixed: FixedFilter | None = None
    history: HistoryView | None = None

    @property
    def spec(self) -> Spec:
        """The spec as it was generated, its scalar with it."""
        return self.code.model.spec

    @cached_property
    def prediction(self) -> Prediction:
        """What the filter will take of a Cortex-M4F."""
        return _predicted(self.code, self.scalar, self.view)

    @cached_property
    def summary(self) -> Summary:
        """What the build table shows."""
        return _summary(self.real, self.view.ram, self.prediction, self.told)

    @cached_property
    def declarations(self) -> Declarations:
        """What the header declares."""
        return declarations(self.view, self.history)


def build(spec: Spec, scalar: str | None = None, log: Log | None = None, *, judge: bool = True) -> Generated:
    """Generate a spec's files. scalar overrides the spec's; log: what a q scalar takes its ranges from, beside
    simulated runs and the log that the spec names. Raises SpecError.

    judge: whether a budget that the prediction exceeds is an error.
    """
    overridden = scalar is not None and scalar != spec.scalar
    if scalar is not None:
        spec = replace(spec, scalar=scalar)
    try:
        return _built(spec, overridden, log, judge)
    except RecursionError:
        cure = "use fewer substeps, shorter formulas, or definitions (let) for what they have in common"
        raise SpecError.at(spec.dynamics.place, "the program of a step is nested too deeply", cure) from None


def _built(spec: Spec, overridden: bool, log: Log | None, judge: bool) -> Generated:
    if spec.scalar not in SCALARS:
        return _fixed(spec, overridden, log, judge)
    code = build_filter(spec, SCALARS[spec.scalar], RESERVED)
    try:
        view = make_view(code, SCALARS[spec.scalar], overridden)
    except OverflowError as error:
        place = spec.places.get("scalar", spec.place)
        raise SpecError.at(
            place, f"{spec.scalar} cannot carry the model: {error}", "use double, or other units"
        ) from None
    history = history_view(code, view, SCALARS[spec.scalar])
    made = Generated(
        _rendered(view, history), code, view, SCALARS[spec.scalar], code, _past(history), history=history
    )  # fmt: skip
    return _judged(made, judge)


def _rendered(view: View, history: HistoryView | None) -> dict[str, str]:
    """The files, each with the hash of its body."""
    texts = render(view) if history is None else render(view) | render_history(view, history)
    return {name: sealed(name, text) for name, text in texts.items()}


def _past(history: HistoryView | None) -> list[str]:
    if history is None:
        return []
    return [f"history of {history.steps} steps: {history.ram} bytes of RAM, the filter's own in it"]


def _predicted(code: FilterCode, scalar: Scalar, view: View) -> Prediction:
    routines = () if view.routines is None else (*view.routines.ops, *view.routines.own)
    return predict(code.model.spec, code, scalar, view.ram, routines)


def _judged(made: Generated, judge: bool) -> Generated:
    """The same, held against the spec's budgets, if it has any and they are to be judged."""
    code = made.spec.code
    if judge and (code.flash, code.ram, code.stack) != (None, None, None):
        mistakes = exceeded(made.spec, made.prediction)
        if mistakes:
            raise SpecError(mistakes)
    return made


def _fixed(spec: Spec, overridden: bool, log: Log | None, judge: bool) -> Generated:
    limit_substeps(spec)
    scalar = Fixed(spec.scalar, spec.fixed.rounding)
    real = build_filter(spec, scalar, RESERVED)
    logs = [each for each in (_named(spec), log) if each is not None]
    result = build_fixed(real, scalar, logs)
    view = make_view(result.code, scalar, overridden, result.view)
    history = history_view(result.code, view, scalar)
    told = [UNROLLED] if spec.code.unroll == "none" else []
    told += [*_past(history), *result.told, "value of raw 1, range, head-room:"]
    told += [f"  {line}" for line in result.view.table]
    made = Generated(_rendered(view, history), result.code, view, scalar, real, told, result, history)
    return _judged(made, judge)


def _named(spec: Spec) -> Log | None:
    """The log that a spec names, by its path from the spec's folder. SpecError where it cannot be read."""
    if spec.fixed.log is None:
        return None
    path = Path(spec.file).parent / spec.fixed.log
    try:
        return read(path, spec)
    except OSError as error:
        reason = error.strerror or str(error)
    except KfgenError as error:
        reason = str(error)
    raise SpecError.at(spec.fixed.log_place, f"the log {path} cannot be read: {reason}", "name a log of this filter")


def _summary(code: FilterCode, ram: int, prediction: Prediction, told: Sequence[str]) -> Summary:
    rows = []
    for function in code.functions:
        if function.name == "predict" or function.name.startswith("update_"):
            rows.append((function.name, operations(function.body) or {}))
    notes = [code.description]
    if code.order != tuple(range(len(code.order))):
        notes.append("inner order: " + " ".join(code.model.errors[i] for i in code.order))
    for mode in code.modes:
        inner = " ".join(code.model.errors[i] for i in mode.order)
        order = "" if mode.order == code.order else f"; inner order: {inner}"
        notes.append(f"{mode.name}: {mode.description}{order}")
    notes += [*code.remarks, *told]
    return Summary(rows, ram, notes, prediction, code.forms)


def generate(spec: Spec, scalar: str | None = None) -> dict[str, str]:
    """File name -> text of a spec's C. Raises SpecError."""
    return build(spec, scalar).files
