"""What a filter has to answer along a track in floating point: from the reference.

Where the model amplifies rounding, the record ends before a reference whose x is rounded to a float after every call
departs from the one that is not; a self-test that fails then tells of the compiler or the processor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.geometry import part_of
from kfgen.reference import ReferenceFilter, reference
from kfgen.reference.status import Status
from kfgen.scalar_names import DOUBLE, FLOAT
from kfgen.selftest.track import Track
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec

Array = NDArray[np.float64]

TOLERANCES = {FLOAT: 1e-2, DOUBLE: 1e-6}
"""Largest error of x in sigma, and of a variance relative to itself."""


FINEST = {FLOAT: 2.0**-22, DOUBLE: 2.0**-44}
"""What recorded states are multiples of, at least, relative to their size."""


@dataclass(frozen=True)
class Record:
    """The track, x [k, n] and the diagonal of P [k, n] after each step (None where a filter keeps no covariance).

    outputs, deviations (k, outputs): what the filter tells after each step. Where statuses are given, one of each step,
    all are raw numbers of the scalar type that must come out to the bit;
    else tolerance says how near.
    """

    track: Track
    x: Array
    variance: Array | None
    tolerance: float
    initial: Array  # the diagonal of P before the first step [n]
    statuses: tuple[int, ...] | None = None
    outputs: Array = field(default_factory=lambda: np.empty((0, 0)))
    deviations: Array = field(default_factory=lambda: np.empty((0, 0)))


def record(spec: Spec, track: Track) -> Record:
    """The record of a spec in floating point. KfgenError where not one step can be recorded."""
    tolerance = TOLERANCES[spec.scalar]
    # rounded to a float's precision for double too: a self-test also runs where a double has four bytes
    ref, coarse = reference(spec), reference(spec)
    steady = spec.filter.gain is not None and spec.imm is None
    n = len(spec.states)
    initial = np.zeros(n) if steady else np.diag(ref.P).copy()
    xs, variances = [], []
    told: list[tuple[list[float], list[float]]] = []
    with np.errstate(all="ignore"):
        for k in range(len(track.dt)):
            if not _stepped(spec, ref, track, k) or not _stepped(spec, coarse, track, k, rounded=True):
                break
            variance = np.zeros(n) if steady else np.diag(ref.P).copy()
            if not steady and not _near(ref, coarse, variance):
                break
            if spec.outputs:
                told.append((list(ref.outputs.values()), list(ref.output_std.values())))
                if not _tells(told[-1], coarse):
                    break
            xs.append(ref.x.copy())
            variances.append(variance)
    if not xs:
        raise KfgenError(f"{spec.name}: the reference does not get through one step of a simulated run")
    x, variance = np.array(xs), np.array(variances)
    sigma = np.sqrt(np.maximum(variance, 0.0))
    # coarser than what another machine's libm may change, finer than what is tested
    quantum = np.maximum(sigma * tolerance / 64, np.abs(x).max(axis=0) * FINEST[spec.scalar])
    x = np.array([[_rounded(v, q) for v, q in zip(*rows, strict=True)] for rows in zip(x, quantum, strict=True)])
    variance = np.array([[_rounded(v, abs(v) * tolerance / 64) for v in row] for row in variance])
    outputs = np.array(told[: len(x)]).reshape(-1, 2, len(spec.outputs))
    y, deviation = outputs[:, 0], outputs[:, 1]
    fine = np.maximum(deviation * tolerance / 64, np.abs(y).max(axis=0, initial=0.0) * FINEST[spec.scalar])
    y = np.array([[_rounded(v, q) for v, q in zip(*rows, strict=True)] for rows in zip(y, fine, strict=True)])
    deviation = np.array([[_rounded(v, abs(v) * tolerance / 64) for v in row] for row in deviation])
    return Record(
        track.first(len(x)), x, None if steady else variance, tolerance, initial, None, y, deviation,
    )  # fmt: skip


def _near(ref: ReferenceFilter, coarse: ReferenceFilter, variance: Array) -> bool:
    parts = [part_of(ref.model.periods.get(i)) for i in range(len(ref.x))]
    error = np.abs([part.local(a, b) for part, a, b in zip(parts, ref.x, coarse.x, strict=True)])
    allowed = TOLERANCES[FLOAT] / 8 * np.sqrt(np.maximum(variance, 0.0)) + 1e-6 * np.abs(ref.x)
    apart = np.abs(np.diag(coarse.P) - variance) > TOLERANCES[FLOAT] / 8 * variance + 1e-6 * np.max(variance)
    return not (np.any(error > allowed) or np.any(apart))


def _tells(told: tuple[list[float], list[float]], coarse: ReferenceFilter) -> bool:
    """Whether outputs and their deviations are finite, and no rounding has them jump."""
    apart = np.abs(np.array(told) - [list(coarse.outputs.values()), list(coarse.output_std.values())])
    y, deviation = map(np.abs, told)
    return bool(np.all(apart <= TOLERANCES[FLOAT] / 8 * deviation + 1e-6 * np.array([y, deviation])))


def _stepped(spec: Spec, kf: ReferenceFilter, track: Track, k: int, rounded: bool = False) -> bool:
    """Make the calls of a step; False where one fails."""
    for status in _statuses(spec, kf, track, k):
        if status >= Status.ERROR or not np.all(np.isfinite(kf.x)):
            return False
        if rounded:
            kf.displace(lambda x: x.astype(np.float32).astype(np.float64))  # of a bank, that of every mode
    return True


def _statuses(spec: Spec, kf: ReferenceFilter, track: Track, k: int) -> Iterator[int]:
    u = track.u[k] if spec.inputs else None
    run_time = spec.dt is not None and spec.dt.run_time
    yield kf.predict(u=u, dt=float(track.dt[k])) if run_time else kf.predict(u=u)
    for i, (sensor, place) in enumerate(readings_of(spec)):
        if k % (i + 1) == 0:
            z, own = np.split(track.z[k, place], [len(sensor.components)])
            yield kf.update(sensor.name, z, u=u, inputs=own if sensor.inputs else None)


def _rounded(value: float, quantum: float) -> float:
    """To a multiple of the power of two below the quantum."""
    if quantum <= 0 or not np.isfinite(quantum):
        return float(value)
    unit = 2.0 ** int(np.floor(np.log2(quantum)))
    return float(round(value / unit) * unit)
