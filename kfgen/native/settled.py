"""A log whose measurements came late, as it would have been had each of them come in time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kfgen.native.run import Plan


@dataclass(frozen=True)
class Settled:
    """work: the calls, at their time. row [N]: where the rows of the log stand in it. late [k, 3]: of each reading that
    was moved where it stands now, the row in which it came, and its sensor."""

    work: Plan
    row: NDArray[np.int64]
    late: NDArray[np.int64]


def settled(work: Plan, steps: int) -> Settled:
    """Each late reading in a row of its own behind the prediction to whose time it belongs.

    steps: how many predictions the past holds; what is older still, or than the first row, is left out.
    """
    rows = len(work.t)
    now = np.cumsum(work.step != 0)
    came, sensor = np.nonzero((work.mask != 0) & (work.age != 0))
    age = work.age[came, sensor].astype(np.int64)
    kept = age <= np.minimum(steps, now[came])
    came, sensor, age = came[kept], sensor[kept], age[kept]
    made = now[came] - age
    origin = np.concatenate([np.arange(rows), came])
    step = np.concatenate([work.step, np.zeros(len(came), work.step.dtype)])
    order = np.lexsort([
        np.concatenate([np.full(rows, -1), sensor]), origin, step == 0, np.concatenate([now, made]),
    ])  # fmt: skip
    mask = np.concatenate([np.where(work.age != 0, 0, work.mask), np.zeros((len(came), work.mask.shape[1]))])
    mask[rows + np.arange(len(came)), sensor] = work.mask[came, sensor]
    times = np.concatenate([work.t[:1], work.t[work.step != 0]])
    t, dt = np.concatenate([work.t, times[made]]), np.concatenate([work.dt, np.zeros(len(came))])
    moved = Plan(t, step, dt, work.u[origin], mask.astype(np.uint32), work.z[origin], np.zeros_like(work.age[origin]))
    place = np.argsort(order)
    found = {name: getattr(moved, name)[order] for name in ("t", "step", "dt", "u", "mask", "z", "age")}
    return Settled(replace(moved, **found), place[:rows], np.column_stack([place[rows:], came, sensor]))
