"""A whole log through a filter, row by row."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kfgen.reference.arguments import components_used
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.replayed import Replayed
from kfgen.reference.status import Status


@dataclass(frozen=True)
class Run:
    """A filter's course over a log of r rows, after each row.

    x (r, nx), var (r, n): the estimate and the diagonal of its covariance. nis: sensor -> (r), NaN in rows
    without an update of it (or with one that failed). status (r): the bits of the row's calls, or-ed. mu (r, B):
    the probabilities of the modes of an imm, else None. outputs, output_std: name -> (r), of a spec with outputs.
    """

    x: Matrix
    var: Matrix
    nis: dict[str, Vector]
    status: NDArray[np.int64]
    mu: Matrix | None = None
    outputs: dict[str, Vector] = field(default_factory=dict)
    output_std: dict[str, Vector] = field(default_factory=dict)


def replay(kf: Replayed, log: Mapping[str, ArrayLike], seen: Callable[[int], None] = lambda row: None) -> Run:
    """Per row: predict, then the updates in the spec's order; then `seen` is called with the row.

    The log maps columns (`t` in s, `<input>`, `<sensor>.<component>`, `<sensor>.<its own input>`) to values, NaN where
    there is no measurement. Run-time dt: t minus the last row's t, no predict in the first row and for equal t; fixed
    dt: one predict per row, where there is a t none for equal t. A sensor with missing components is updated with the
    others where it is `partial`, and not at all where it is not, or where one of its inputs is missing.
    Raises ValueError for a missing column (all columns
    of a sensor may be missing).
    """
    columns = {name: np.asarray(column, dtype=np.float64) for name, column in log.items()}
    rows = len(next(iter(columns.values()), ()))
    run_time = kf.spec.dt is not None and kf.spec.dt.run_time
    fixed = kf.spec.dt is not None and not run_time and "t" in columns
    needed = [*kf.model.inputs, *(["t"] if run_time else [])]
    missing = [name for name in needed if name not in columns]
    if missing:
        raise ValueError(f"the log has no column {', '.join(missing)}")
    inputs = np.column_stack([columns[name] for name in kf.model.inputs] or [np.zeros((rows, 0))])
    readings: dict[str, Matrix] = {}
    for sensor in kf.sensors.values():
        names = [f"{sensor.name}.{name}" for name in (*sensor.components, *sensor.own)]
        if any(name in columns for name in names):
            absent = np.full(rows, math.nan)
            readings[sensor.name] = np.column_stack([columns.get(name, absent) for name in names])

    result = Run(
        np.zeros((rows, kf.model.nx)),
        np.zeros((rows, kf.model.n)),
        {name: np.full(rows, math.nan) for name in kf.sensors},
        np.zeros(rows, dtype=np.int64),
        None if kf.spec.imm is None else np.zeros((rows, len(kf.spec.imm.modes))),
    )
    last: float | None = None
    for row in range(rows):
        u = inputs[row] if kf.model.inputs else None
        status = 0
        if run_time:
            t = float(columns["t"][row])
            if last is not None and t != last:
                status |= kf.predict(u, t - last)
            if math.isfinite(t):
                last = t
        elif not (fixed and row and columns["t"][row] == columns["t"][row - 1]):
            status |= kf.predict(u)
        for name, reading in readings.items():
            status |= _measure(kf, name, reading[row], u, result, row)
        result.status[row] = status
        result.x[row], result.var[row] = kf.x, kf.P.diagonal()
        if result.mu is not None:
            result.mu[row] = kf.mu
        if kf.spec.outputs:
            for course, told in ((result.outputs, kf.outputs), (result.output_std, kf.output_std)):
                for name, number in told.items():
                    course.setdefault(name, np.zeros(rows))[row] = number
        seen(row)
    return result


def _measure(kf: Replayed, name: str, z: Vector, u: Vector | None, result: Run, row: int) -> int:
    """One sensor of one row: its status, 0 where there is nothing to do."""
    sensor = kf.sensors[name]
    z, own = np.split(z, [sensor.m])
    present = ~np.isnan(z)
    if np.any(np.isnan(own)) or not np.any(present) or not (sensor.partial or np.all(present)):
        return 0
    mask = sum(1 << i for i in range(sensor.m) if present[i]) if sensor.partial else None
    if not components_used(sensor, mask):
        return 0
    status = kf.update(name, z, u if sensor.takes_inputs else None, mask, own if sensor.own else None)
    if status < Status.ERROR:
        result.nis[name][row] = kf.nis
    return status
