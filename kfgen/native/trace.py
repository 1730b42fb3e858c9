"""A log through a compiled filter call by call: the whole estimate after each of them, not only after each row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kfgen.logs import Log
from kfgen.native.run import Plan, fixed_step, follow, plan
from kfgen.native.values import Array
from kfgen.status import ERROR, Status

if TYPE_CHECKING:
    from kfgen.native.filter import NativeFilter


@dataclass(frozen=True)
class Trace:
    """c calls along a log of r rows, in order.

    work: what was to be done, row by row. row [c]: its row. sensor [c]: -1 for a predict, else the index of the sensor
    that was updated. x [c + 1, n], P [c + 1, n, n]: before the first call, then after each. nis [c]: of updates that
    returned no error, else NaN. status [c]: what the call returned. mu [c, modes] of an imm, else None.
    """

    work: Plan
    row: NDArray[np.int64]
    sensor: NDArray[np.int64]
    x: Array
    P: Array
    nis: Array
    status: NDArray[np.uint32]
    mu: Array | None = None

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Calls [c] that changed the estimate: neither refused nor gated."""
        kept: NDArray[np.bool_] = (self.status < ERROR) & (self.status & Status.GATED.value == 0)
        return kept

    def last(self) -> NDArray[np.int64]:
        """Where in x and P the estimate after each row [r] is."""
        place: NDArray[np.int64] = np.searchsorted(self.row, np.arange(len(self.work.t)), side="right")
        return place


def trace(kf: NativeFilter, log: Log, progress: Callable[[int, int], None] | None = None) -> Trace:
    """Run a filter over a log, on from its present state; arguments as for `kfgen.native.run.run`."""
    spec, work = kf.spec, plan(kf.spec, log, fixed_step(kf.spec))
    row, call = np.nonzero(np.column_stack([work.step != 0, work.mask != 0]))
    step = (call == 0).astype(np.uint8)
    mask = np.zeros((len(row), len(spec.measurements)), np.uint32)
    updates = np.flatnonzero(call)
    mask[updates, call[updates] - 1] = work.mask[row[updates], call[updates] - 1]
    calls = Plan(work.t[row], step, work.dt[row], work.u[row], mask, work.z[row], work.age[row])
    x0, P0 = kf.x, kf.P
    done = follow(kf.struct, spec, calls, progress, whole=True)
    assert done.P is not None
    nis = np.full(len(row), np.nan)
    for i, each in enumerate(done.nis.values()):
        nis[call == i + 1] = each[call == i + 1]
    x, P = np.concatenate([x0[None], done.x]), np.concatenate([P0[None], done.P])
    return Trace(work, row, call - 1, x, P, nis, done.status, done.mu)
