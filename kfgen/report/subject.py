"""What a report is about: a spec, what is generated of it, and its filter's course over logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.geometry import part_of
from kfgen.logs import Log
from kfgen.native.trace import Trace, trace
from kfgen.report.walk import Walk, Walker
from kfgen.spec.constants import value
from kfgen.spec.types import Spec

if TYPE_CHECKING:
    from kfgen.generate import Generated

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

ANALYSED = 4000
"""Rows of a log that are linearised one by one, which takes a millisecond each; all others are run all the same."""


@dataclass(frozen=True)
class Drive:
    """A log and what the filter made of it. smoothed [r, n]: by all of it, None where it cannot be."""

    title: str
    log: Log
    trace: Trace
    walk: Walk
    smoothed: Array | None = None

    @cached_property
    def x(self) -> Array:
        """After each row [r, n]."""
        return self.trace.x[self.trace.last()]

    @cached_property
    def P(self) -> Array:
        """After each row [r, n, n]."""
        return self.trace.P[self.trace.last()]

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations after each row [r, n]."""
        sigma: Array = np.sqrt(np.maximum(np.einsum("kii->ki", self.P), 0.0))
        return sigma


@dataclass(frozen=True)
class Subject:
    """All that sections may ask for. cost: figures by kind of flags; no_cost: why there are none."""

    spec: Spec
    generated: Generated
    drives: Sequence[Drive] = ()
    cost: Mapping[str, Any] = field(default_factory=dict)
    no_cost: str = ""
    target: str = ""
    mhz: float | None = None

    @property
    def states(self) -> list[str]:
        return [state.name for state in self.spec.states]

    @cached_property
    def periods(self) -> list[float | None]:
        return [None if s.period is None else float(value(s.period.tree, self.spec)) for s in self.spec.states]

    def errors(self, drive: Drive) -> Array:
        """Estimate less truth after each row [r, n], NaN where the log has none; angles the shortest way."""
        out = np.full(drive.x.shape, np.nan)
        for i, (name, period) in enumerate(zip(self.states, self.periods, strict=True)):
            truth = drive.log.columns.get(f"true.{name}")
            if truth is None:
                continue
            part = part_of(period)
            out[:, i] = drive.x[:, i] - truth
            if not part.flat:
                out[:, i] = [part.local(a, b) for a, b in zip(drive.x[:, i].tolist(), truth.tolist(), strict=True)]
        return out

    def degrees(self, drive: Drive, sensor: int) -> NDArray[np.int64]:
        """Components that each call of a trace used of a sensor; 0 for other calls and those that only initialise."""
        work, calls = drive.trace.work, drive.trace
        mine = calls.sensor == sensor
        out = np.zeros(len(calls.row), np.int64)
        out[mine] = [int(bits).bit_count() for bits in work.mask[calls.row[mine], sensor].tolist()]
        if self.spec.measurements[sensor].name in [rule.sensor for rule in self.spec.initialize]:
            full = np.flatnonzero(mine & (calls.nis == 0.0))
            out[full[:1]] = 0
        return out


def drive(spec: Spec, kf: Any, log: Log, title: str, progress: Progress) -> Drive:
    """Run, linearise and smooth a log."""
    kf.init()
    found = trace(kf, log)
    rows = min(ANALYSED, log.rows)
    walk = Walker(spec, found).walk(rows, lambda row: progress(row, rows, f"linearising {title}"))
    smoothed = None
    if log.rows <= ANALYSED:
        from kfgen.smoothing import smoothed as smooth

        try:
            smoothed = smooth(spec, log, lambda done, of: progress(done, of, f"smoothing {title}"))[1].x
        except KfgenError:  # what cannot be smoothed is reported without
            smoothed = None
    return Drive(title, log, found, walk, smoothed)
