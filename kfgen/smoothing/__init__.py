"""Fixed-interval smoothing of a log: what a filter would have said, had it known the rest of the log.

Post-processing in numpy, by the reference (`kfgen.reference.rts`): nothing of it is emitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.logs import Source, as_log
from kfgen.native.run import Plan, RunResult, fixed_step, plan
from kfgen.native.settled import Settled, settled
from kfgen.reference.rts import Smoothed
from kfgen.reference.rts import smooth as backward
from kfgen.scalar_names import DOUBLE
from kfgen.spec.sensors import columns_of, readings_of
from kfgen.spec.types import Spec

__all__ = ["Smoothed", "smooth", "smoothed"]


def smooth(spec: Spec, log: Source, progress: Callable[[int, int], None] | None = None) -> RunResult:
    """A log smoothed from the spec's start, a row each as a run gives it; nis and status are the filter's own.

    x, var of a row are those of its instant: rows between which nothing is predicted share them. progress: called
    with (rows done, rows). KfgenError where the log does not fit the spec, or the spec cannot be smoothed.
    """
    work, found = smoothed(spec, log, progress)
    status = found.run.status.astype(np.uint32)
    return RunResult(
        work.t, found.x, found.var, found.run.nis, status, {"the filter": status},
        outputs=found.outputs, output_std=found.output_std,
    )  # fmt: skip


def smoothed(spec: Spec, log: Source, progress: Callable[[int, int], None] | None = None) -> tuple[Plan, Smoothed]:
    """The same with full covariances, beside what was done in each row.

    What came late is taken in where it was made: then all of it is known. Older than the filter takes, or than the
    first prediction, it is left out.
    """
    data = as_log(log, spec)
    work = plan(spec, data, fixed_step(spec))
    columns = {**data.columns, **{each.name: work.u[:, i] for i, each in enumerate(spec.inputs)}}
    moved = None
    if spec.history is not None and work.age.any():
        if spec.dt is None:
            raise KfgenError(f"{spec.name} cannot be smoothed over late measurements: without `dt` no row has a time")
        moved = _from_first(settled(work, spec.history.steps), spec.dt.run_time)
        columns = _columns(spec, moved.work)
    rows = data.rows if moved is None else len(moved.work.t)

    def seen(row: int) -> None:
        if progress is not None and (row % 64 == 63 or row + 1 == rows):
            progress(row + 1, rows)

    # what the log does after the drive is done in double, whatever the firmware's scalar
    found = backward(replace(spec, scalar=DOUBLE), columns, seen)
    return work, found if moved is None else _as_it_came(spec, found, moved)


def _from_first(moved: Settled, run_time: bool) -> Settled:
    """Without the rows before the first prediction of a fixed step: columns of a log cannot tell of them."""
    early = 0 if run_time else int(np.argmax(moved.work.step != 0))
    work = Plan(**{each.name: getattr(moved.work, each.name)[early:] for each in fields(Plan)})
    late = moved.late - np.array([early, 0, 0])
    return Settled(work, moved.row - early, late[late[:, 0] >= 0])


def _columns(spec: Spec, work: Plan) -> dict[str, NDArray[np.float64]]:
    """Calls as columns of a log."""
    columns = {"t": work.t, **{each.name: work.u[:, i] for i, each in enumerate(spec.inputs)}}
    for i, (sensor, place) in enumerate(readings_of(spec)):
        z = np.where(work.mask[:, i, None] != 0, work.z[:, place], np.nan)
        for k in range(len(sensor.components)):
            z[work.mask[:, i] >> k & 1 == 0, k] = np.nan
        columns |= dict(zip(columns_of(sensor), z.T, strict=True))
    return columns


def _as_it_came(spec: Spec, found: Smoothed, moved: Settled) -> Smoothed:
    """The rows of the log, with what was said of a late reading in the row in which it came."""
    nis = {name: values[moved.row] for name, values in found.run.nis.items()}
    status = found.run.status[moved.row]
    for place, row, sensor in moved.late.tolist():
        name = spec.measurements[sensor].name
        nis[name][row] = found.run.nis[name][place]
        status[row] |= found.run.status[place]
    run = replace(found.run, x=found.run.x[moved.row], var=found.run.var[moved.row], nis=nis, status=status)
    told = ({name: values[moved.row] for name, values in each.items()} for each in (found.outputs, found.output_std))
    return Smoothed(found.x[moved.row], found.P[moved.row], run, *told)
