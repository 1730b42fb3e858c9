"""Fixed-interval smoothing of a log: what a filter would have said, had it known the rest of the log.

Post-processing in numpy, by the reference (`kfgen.reference.rts`): nothing of it is emitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kfgen.logs import Source, as_log
from kfgen.native.run import Plan, RunResult, fixed_step, plan
from kfgen.reference.rts import Smoothed
from kfgen.reference.rts import smooth as backward
from kfgen.scalar_names import DOUBLE
from kfgen.spec.types import Spec

__all__ = ["Smoothed", "smooth", "smoothed"]


def smooth(spec: Spec, log: Source, progress: Callable[[int, int], None] | None = None) -> RunResult:
    """A log smoothed from the spec's start, a row each as a run gives it; nis and status are the filter's own.

    x, var of a row are those of its instant: rows between which nothing is predicted share them. progress: called
    with (rows done, rows). KfgenError where the log does not fit the spec, or the spec cannot be smoothed.
    """
    work, found = smoothed(spec, log, progress)
    status = found.run.status.astype(np.uint32)
    return RunResult(work.t, found.x, found.var, found.run.nis, status, {"the filter": status})


def smoothed(spec: Spec, log: Source, progress: Callable[[int, int], None] | None = None) -> tuple[Plan, Smoothed]:
    """The same with full covariances, beside what was done in each row."""
    data = as_log(log, spec)
    work = plan(spec, data, fixed_step(spec))
    rows = data.rows

    def seen(row: int) -> None:
        if progress is not None and (row % 64 == 63 or row + 1 == rows):
            progress(row + 1, rows)

    # what the log does after the drive is done in double, whatever the firmware's scalar
    columns = {**data.columns, **{each.name: work.u[:, i] for i, each in enumerate(spec.inputs)}}
    return work, backward(replace(spec, scalar=DOUBLE), columns, seen)
