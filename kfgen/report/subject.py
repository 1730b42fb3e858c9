"""What a report is about: a spec, what is generated of it, and its filter's course over logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kfgen.apart import differences
from kfgen.errors import KfgenError
from kfgen.logs import Log
from kfgen.native.settled import settled
from kfgen.native.trace import Trace, trace
from kfgen.report.walk import Walk, Walker
from kfgen.spec.constants import value
from kfgen.spec.sensors import degrees_of
from kfgen.spec.types import Spec

if TYPE_CHECKING:
    from kfgen.generate import Generated

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

ANALYSED = 4000
"""Rows of a log that are linearised one by one, which takes a millisecond each; all others are run all the same."""


@dataclass(frozen=True)
class Drive:
    """A log and what the filter made of it. walk: with late readings where they were made. smoothed [r, nx]: by all of
    it, None where it cannot be."""

    title: str
    log: Log
    trace: Trace
    walk: Walk
    smoothed: Array | None = None

    @cached_property
    def x(self) -> Array:
        """After each row [r, nx]."""
        return self.trace.x[self.trace.last()]

    @cached_property
    def P(self) -> Array:
        """After each row [r, n, n]."""
        return self.trace.P[self.trace.last()]

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations of the errors after each row [r, n]."""
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

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates of the error [n]: states, and three of each rotation."""
        return self.spec.errors

    @property
    def units(self) -> list[str]:
        """Of the errors."""
        units = {state.name: state.unit for state in self.spec.states}
        return [units.get(name, "rad") for name in self.names]

    @cached_property
    def periods(self) -> list[float | None]:
        return [None if s.period is None else float(value(s.period.tree, self.spec)) for s in self.spec.states]

    def errors(self, drive: Drive) -> Array:
        """Estimate less truth after each row [r, n], NaN where the log has none; angles the shortest way."""
        absent = np.full(len(drive.x), np.nan)
        truth = np.column_stack([drive.log.columns.get(f"true.{name}", absent) for name in self.states])
        return differences(self.spec, drive.x, truth)

    def sigma(self, drive: Drive, state: int) -> Array | None:
        """The standard deviation of a state after each row [r]; None for a number of a quaternion, which has none."""
        name = self.states[state]
        return drive.sigma[:, self.names.index(name)] if name in self.names else None

    def degrees(self, drive: Drive, sensor: int) -> NDArray[np.int64]:
        """Degrees of freedom that each call of a trace used of a sensor; 0 for others and those that only set."""
        work, calls = drive.trace.work, drive.trace
        mine = (calls.sensor == sensor) & calls.updates
        out = np.zeros(len(calls.row), np.int64)
        whole = self.spec.measurements[sensor]
        out[mine] = [degrees_of(whole, bits) for bits in work.mask[calls.row[mine], sensor].tolist()]
        return out


def drive(spec: Spec, kf: Any, log: Log, title: str, progress: Progress) -> Drive:
    """Run, linearise and smooth a log."""
    kf.init()
    found = in_time = trace(kf, log)
    if spec.history is not None and found.work.age.any():
        kf.init()
        in_time = trace(kf, settled(found.work, spec.history.steps).work)
    rows = min(ANALYSED, len(in_time.work.t))
    walk = Walker(spec, in_time).walk(rows, lambda row: progress(row, rows, f"linearising {title}"))
    if rows == len(in_time.work.t):
        walk.rows = log.rows
    smoothed = None
    if log.rows <= ANALYSED:
        from kfgen.smoothing import smoothed as smooth

        try:
            smoothed = smooth(spec, log, lambda done, of: progress(done, of, f"smoothing {title}"))[1].x
        except KfgenError:  # what cannot be smoothed is reported without
            smoothed = None
    return Drive(title, log, found, walk, smoothed)
