"""A log through a compiled filter call by call: the whole estimate after each of them, not only after each row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kfgen.logs import Log
from kfgen.native.first import firsts
from kfgen.native.run import Plan, fixed_step, follow, plan
from kfgen.native.values import Array
from kfgen.status import ERROR, Status

if TYPE_CHECKING:
    from kfgen.native.filter import NativeFilter


@dataclass(frozen=True)
class Trace:
    """c calls along a log of r rows, in order.

    work: what was to be done, row by row. row [c]: its row. sensor [c]: -1 for a predict, else the index of the sensor
    that was updated. x [c + 1, nx], P [c + 1, n, n]: before the first call, then after each. nis [c]: of updates that
    returned no error, else NaN. status [c]: what the call returned. setting, waiting [c]: calls that set a first
    estimate, and those that do nothing since it has not come. mu [c, modes] of an imm, else None. outputs, output_std:
    name -> [c], of a spec with outputs.
    """

    work: Plan
    row: NDArray[np.int64]
    sensor: NDArray[np.int64]
    x: Array
    P: Array
    nis: Array
    status: NDArray[np.uint32]
    setting: NDArray[np.bool_]
    waiting: NDArray[np.bool_]
    mu: Array | None = None
    outputs: Mapping[str, Array] = field(default_factory=dict)
    output_std: Mapping[str, Array] = field(default_factory=dict)

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Calls [c] that changed the estimate: neither refused nor gated, nor in vain."""
        kept: NDArray[np.bool_] = (self.status < ERROR) & (self.status & Status.GATED.value == 0)
        return kept & ~self.waiting

    @property
    def updates(self) -> NDArray[np.bool_]:
        """Calls [c] that compared a measurement with a prediction."""
        compared: NDArray[np.bool_] = (self.sensor >= 0) & ~self.setting & ~self.waiting
        return compared

    def last(self) -> NDArray[np.int64]:
        """Where in x and P the estimate after each row [r] is."""
        place: NDArray[np.int64] = np.searchsorted(self.row, np.arange(len(self.work.t)), side="right")
        return place


def trace(kf: NativeFilter, log: Log | Plan, progress: Callable[[int, int], None] | None = None) -> Trace:
    """Run a filter over a log, or what is planned of it, on from its present state; as `kfgen.native.run.run` does."""
    spec = kf.spec
    work = log if isinstance(log, Plan) else plan(spec, log, fixed_step(spec))
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
    bits = np.where(call > 0, work.mask[row, call - 1], 0)
    setting, waiting = firsts(spec, call - 1, bits, done.status < ERROR)
    nis[setting | waiting] = np.nan
    return Trace(
        work, row, call - 1, x, P, nis, done.status, setting, waiting, done.mu, done.outputs, done.output_std
    )
