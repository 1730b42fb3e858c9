"""A log's calls, linearised one by one: innovations, what each source adds to the covariance, what sensors see.

The linear covariance analysis (Maybeck 1979, section 6.8) is exact for a linear filter: the covariance of the error is
a sum over its independent causes, and each part goes through F and I - K H by itself. A curved model is taken to first
order along the track of the filter, a bank by its likeliest mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from kfgen.native.trace import Trace
from kfgen.reference.algorithm import Estimate
from kfgen.reference.build import reference
from kfgen.reference.clock import Clock, step_of
from kfgen.reference.ekf import Ekf
from kfgen.reference.ekf import Measured as Linear
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.joseph import update
from kfgen.reference.linalg import symmetric
from kfgen.reference.measuring import Measured, Scalars
from kfgen.reference.model import Context, fixed_step
from kfgen.reference.process import Process
from kfgen.reference.sensor import Reading
from kfgen.reference.shares import shares, sources
from kfgen.reference.status import StepError
from kfgen.reference.steady import Steady
from kfgen.reference.ukf import Ukf
from kfgen.scalar_names import DOUBLE
from kfgen.spec.modes import mode_specs
from kfgen.spec.sensors import in_use, readings_of
from kfgen.spec.types import Spec

Array = NDArray[np.float64]

FAR = 1e12  # of the transition from the start: an unstable model is watched until then


@dataclass(frozen=True)
class Innovations:
    """Of one sensor, k of them in order.

    t [k]. y, sigma, e [k, m]: as they were, their standard deviations, and whitened by the root of their covariance;
    of a quaternion three. NaN for components that were not used. taken [k]: whether the filter took them.
    """

    t: Array
    y: Array
    sigma: Array
    e: Array
    taken: NDArray[np.bool_]


@dataclass
class Walk:
    """What was found.

    rows: how many of the log. sources: s causes of error. parts [s, n, n]: of the covariance at the end, by cause. H:
    sensor -> stacked [k, n], each row divided by its noise's deviation, of the state at the start. F_used, H_used,
    Q_used: where something is not zero in any step. skipped: calls at which the model has no finite derivative.
    """

    rows: int
    sources: tuple[str, ...]
    parts: Array
    innovations: dict[str, Innovations]
    H: dict[str, Array]
    F_used: NDArray[np.bool_]
    H_used: dict[str, NDArray[np.bool_]]
    Q_used: NDArray[np.bool_]
    skipped: int = 0


@dataclass
class _Seen:
    t: list[float] = field(default_factory=list)
    y: list[Array] = field(default_factory=list)
    sigma: list[Array] = field(default_factory=list)
    e: list[Array] = field(default_factory=list)
    taken: list[bool] = field(default_factory=list)


class Walker:
    """Follows a trace of a spec's filter."""

    def __init__(self, spec: Spec, trace: Trace) -> None:
        self.spec, self.trace = spec, trace
        self.filters: list[ReferenceFilter] = [reference(replace(each, scalar=DOUBLE)) for each in mode_specs(spec)]
        self.processes = [Process(kf.model) for kf in self.filters]
        model = self.filters[0].model
        self.model, self.n = model, model.n
        self.step = step_of(spec, model.number)
        sensors = [sensor.name for sensor in spec.measurements]
        self.own = dict.fromkeys(name for process in self.processes for name in sources(process))
        self.sources = ("start", *(f"sensor.{name}" if name == "start" else name for name in sensors), *self.own)
        self.seen = {name: _Seen() for name in sensors}
        self.H: dict[str, list[Array]] = {name: [] for name in sensors}
        self.places = [place for _, place in readings_of(spec)]
        self.H_used = {sensor.name: np.zeros((len(sensor.errors), self.n), bool) for sensor in spec.measurements}
        self.F_used = np.zeros((self.n, self.n), bool)
        self.Q_used = np.zeros((self.n, self.n), bool)
        self.parts = np.zeros((len(self.sources), self.n, self.n))
        self.onward: Array | None = np.eye(self.n)
        self.skipped = 0

    def walk(self, rows: int, progress: Callable[[int], None] = lambda row: None) -> Walk:
        """Of the first rows of the log."""
        trace = self.trace
        self.parts[0] = trace.P[0]
        clock = Clock(Fraction(1) if self.spec.dt is None else fixed_step(self.spec))
        accepted = trace.accepted
        for c in range(int(np.searchsorted(trace.row, rows))):
            row = int(trace.row[c])
            if trace.waiting[c]:
                continue
            mode = 0 if trace.mu is None else int(np.argmax(trace.mu[max(c - 1, 0)]))
            u = trace.work.u[row]
            try:
                with np.errstate(all="ignore"):
                    if trace.sensor[c] >= 0:
                        self._update(c, mode, Context(self.model.values, u, clock.now, 0.0), bool(accepted[c]))
                    elif accepted[c]:
                        dt = self.step.nominal
                        if self.step.run_time:
                            dt = self.step.clamped(float(trace.work.dt[row]))[0]
                        self._predict(trace.x[c], mode, Context(self.model.values, u, clock.now, dt))
                        clock = clock.advanced(dt)
            except (StepError, np.linalg.LinAlgError):
                self.skipped += 1
            if c % 256 == 0:
                progress(row)
        return Walk(
            rows, self.sources, self.parts, {name: self._innovations(name) for name in self.seen},
            {name: np.vstack(blocks) if blocks else np.zeros((0, self.n)) for name, blocks in self.H.items()},
            self.F_used, self.H_used, self.Q_used, self.skipped,
        )  # fmt: skip

    def _predict(self, x: Array, mode: int, context: Context) -> None:
        process = self.processes[mode]
        F, added = shares(process, x, context)
        self.parts = F @ self.parts @ F.T
        for name, term in zip(sources(process), added, strict=True):
            self.parts[self.sources.index(name)] += term
        self.F_used |= F != 0
        self.Q_used |= added.any(axis=0)
        if self.onward is not None:
            self.onward = F @ self.onward
            if not np.abs(self.onward).max() < FAR:
                self.onward = None

    def _update(self, c: int, mode: int, context: Context, accepted: bool) -> None:
        trace, kf = self.trace, self.filters[mode]
        i, row = int(trace.sensor[c]), int(trace.row[c])
        name = self.spec.measurements[i].name
        sensor = kf.sensors[name]
        z, own = np.split(trace.work.z[row, self.places[i]], [sensor.m])
        used = in_use(self.spec.measurements[i], int(trace.work.mask[row, i]))
        if not used:
            return
        if trace.setting[c]:
            self._begin(c, i)
            return
        reading = Reading(sensor, sensor.space.normalised(z), used, replace(context, own=own))
        algorithm = kf.algorithm.of(name)
        start = algorithm.initial()
        detail = algorithm.innovate(Estimate(trace.x[c], trace.P[c], adapted=start.adapted), reading).detail
        y, S, H, R = self._pieces(algorithm, detail, trace.x[c], trace.P[c], reading)
        self._see(name, float(trace.work.t[row]), reading, y, S, accepted)
        if not accepted:
            return
        assert isinstance(algorithm, (Ekf, Ukf))
        rules = replace(algorithm.treatment.rules(context), influence=None, chi2=None)
        P = algorithm.turns[name].P if isinstance(algorithm, Steady) else symmetric(self.parts.sum(axis=0))
        K = np.column_stack([update(P, H, R, e, rules).dx for e in np.eye(len(y))])
        space = self.model.space
        T = space.turned(space.difference(trace.x[c + 1], trace.x[c]), always=False)  # to where the estimate now is
        A = T @ (np.eye(self.n) - K @ H)
        self.parts = A @ self.parts @ A.T
        self.parts[1 + i] += T @ K @ R @ K.T @ T.T
        self.H_used[name][list(reading.rows)] |= H != 0
        if self.onward is not None:
            size = np.sqrt(np.maximum(np.diag(R), 0.0))
            self.H[name].append(H @ self.onward / np.where(size > 0, size, 1.0)[:, None])

    def _begin(self, c: int, i: int) -> None:
        """A first measurement: the variances that it sets come from it."""
        (rule,) = (each for each in self.spec.initialize if each.sensor == self.spec.measurements[i].name)
        for name in rule.variance:
            k = self.spec.errors.index(name)
            self.parts[:, k, :] = self.parts[:, :, k] = 0.0
            self.parts[1 + i, k, k] = self.trace.P[c + 1, k, k]

    def _pieces(
        self, algorithm: object, detail: object, x: Array, P: Array, reading: Reading
    ) -> tuple[Array, Array, Array, Array]:
        """Innovation, its covariance, and H and R of first order."""
        if isinstance(detail, Linear):
            return detail.y, detail.H @ P @ detail.H.T + detail.R, detail.H, detail.R
        linear = reading.sensor.linearise(x, reading)
        if isinstance(detail, Measured):
            return detail.y, detail.S.matrix, linear.H, linear.R
        if isinstance(detail, Scalars):
            return detail.y, detail.H @ P @ detail.H.T + detail.R, linear.H, linear.R
        assert isinstance(algorithm, Steady)
        assert isinstance(detail, np.ndarray)
        turn = algorithm.turns[reading.sensor.name]
        return detail, turn.H @ turn.P @ turn.H.T + turn.R, turn.H, turn.R

    def _see(self, name: str, t: float, reading: Reading, y: Array, S: Array, taken: bool) -> None:
        seen, m = self.seen[name], reading.sensor.space.k
        sigma = np.sqrt(np.maximum(np.diag(S), 0.0))
        try:
            e = np.linalg.solve(np.linalg.cholesky(S), y)
        except np.linalg.LinAlgError:
            e = np.divide(y, sigma, out=np.full(len(y), np.nan), where=sigma > 0)
        for store, values in ((seen.y, y), (seen.sigma, sigma), (seen.e, e)):
            whole = np.full(m, np.nan)
            whole[list(reading.rows)] = values
            store.append(whole)
        seen.t.append(t)
        seen.taken.append(taken)

    def _innovations(self, name: str) -> Innovations:
        seen, m = self.seen[name], len(self.H_used[name])
        y, sigma, e = (np.array(each).reshape(-1, m) for each in (seen.y, seen.sigma, seen.e))
        return Innovations(np.array(seen.t), y, sigma, e, np.array(seen.taken, bool))
