"""A report on a filter and its course over logs: one page for a reviewer, and the same figures as data."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from kfgen.errors import KfgenError
from kfgen.logs import Log, Source, as_log
from kfgen.spec.sensors import late_columns
from kfgen.spec.types import Spec

ROWS = 500  # of the log that is drawn where none is given
COST_ROWS = 60
TARGET = "cortex-m4f"


@dataclass(frozen=True)
class Report:
    """html: the page. data: its figures, as `kfgen report --json` prints them."""

    html: str
    data: Mapping[str, Any]


def nothing(done: int, of: int, what: str) -> None:
    """Progress that nobody looks at."""


def made(
    spec: Spec,
    logs: Sequence[Source] = (),
    simulate: int | None = None,
    target: str = TARGET,
    mhz: float | None = None,
    run: bool = True,
    ranges: Log | None = None,
    progress: Any = nothing,
) -> Report:
    """The report of a spec over logs, and over a simulated one of so many rows; of 500 where there are none.

    target: what costs are measured on; mhz: its clock. run: without, only what the spec and its code tell, which takes
    no compiler. ranges: a log for the ranges of fixed point. progress: called with done, of, what. Raises SpecError,
    KfgenError where matplotlib or a compiler is missing, or a log does not fit.
    """
    from kfgen.generate import build
    from kfgen.report.figures import require_matplotlib
    from kfgen.report.page import page
    from kfgen.report.sections import sections
    from kfgen.report.subject import Subject

    require_matplotlib()
    progress(0, 1, "generating")
    generated = build(spec, log=ranges, judge=False)
    named = [(_title(log, i), as_log(log, spec)) for i, log in enumerate(logs)]
    if run and (simulate is not None or not named):
        from kfgen.simulate import simulate as simulated

        rows = ROWS if simulate is None else simulate
        named.append((f"simulated ({rows} rows)", simulated(spec, rows)))
    drives = _drives(generated, named, progress) if run else []
    cost, no_cost = _cost(generated, named, target, mhz, progress) if run else ({}, "the report was made without a run")
    subject = Subject(spec, generated, drives, cost, no_cost, target, mhz)
    progress(0, 1, "drawing")
    found = sections(subject)
    data: dict[str, Any] = {"name": spec.name, "scalar": spec.scalar, "sha256": spec.sha256}
    for each in found:
        data |= each.data
    return Report(page(subject, found), _plain(data))


def _drives(generated: Any, named: Sequence[tuple[str, Log]], progress: Any) -> list[Any]:
    from kfgen.native import load_filters
    from kfgen.report.subject import drive

    spec = generated.spec
    late = spec.history is not None and any(set(late_columns(spec)) & set(log.columns) for _, log in named)
    (kf,) = load_filters([generated], history=late)
    return [drive(generated.spec, kf, log, title, progress) for title, log in named]


def _cost(
    generated: Any, named: Sequence[tuple[str, Log]], target: str, mhz: float | None, progress: Any
) -> tuple[dict[str, Any], str]:
    """Figures on a target; or why there are none: a missing compiler spoils no report."""
    from kfgen.cost import measure, recommended_flags, target_of

    processor = target_of(target)
    progress(0, 1, "measuring")
    try:
        log = named[0][1]
        found = measure(generated, log, target, rows=COST_ROWS).as_json(mhz)
        flags = recommended_flags(generated.view)
        found["recommended"] = None
        if flags and processor.takes_gcc_flags():
            found["recommended"] = measure(generated, log, target, flags, rows=COST_ROWS).as_json(mhz)
        return {**found, "mhz": mhz}, ""
    except KfgenError as error:
        return {}, str(error).partition("\n")[0]


def _title(log: Source, number: int) -> str:
    if isinstance(log, Log):
        return os.path.basename(log.source)
    return os.path.basename(os.fspath(log)) if isinstance(log, (str, os.PathLike)) else f"log {number + 1}"


def _plain(value: Any) -> Any:
    """Data that JSON can carry: what is not finite is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def report(spec: Spec | str | os.PathLike[str], logs: Sequence[Source] | Source = (), **options: Any) -> dict[str, Any]:
    """What `kfgen report --json` prints, as data. logs: a log or several; options: those of `made`."""
    if not isinstance(spec, Spec):
        from kfgen.spec import load

        spec = load(os.fspath(spec))
    several: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    return dict(made(spec, several, **options).data)
