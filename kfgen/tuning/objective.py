"""How well a filter with given numbers explains logs: the likelihood of its innovations, or its error against truth.

Each number is a run-time parameter of one compiled filter (double), so a trial costs a run at C speed; trials and logs
are spread over the cores, for a run of compiled code leaves the interpreter to the others.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kfgen.apart import differences
from kfgen.errors import KfgenError
from kfgen.logs import Log
from kfgen.native.first import firsts
from kfgen.native.run import Plan, RunResult, fixed_step, follow, plan
from kfgen.scalar_names import DOUBLE
from kfgen.spec.sensors import degrees_of
from kfgen.spec.types import Sensor, Spec
from kfgen.statistics import chi2_quantile
from kfgen.status import ERROR, Status
from kfgen.tuning.opened import Opened, with_values

if TYPE_CHECKING:
    from kfgen.native.filter import NativeFilter

Array = NDArray[np.float64]

FAILED = -1000.0  # what a call that returned an error counts in a log-likelihood
OUTLIER = 0.999  # share of innovations that is no outlier


@dataclass(frozen=True)
class Score:
    """One trial. likelihood: of the rows that are fitted and of those held out. nis: sensor -> mean per degree of
    freedom of either, NaN where there is none. error: what is minimised with `rmse`."""

    likelihood: tuple[float, float]
    nis: Mapping[str, tuple[float, float]]
    error: float = math.nan


@dataclass(frozen=True)
class _Drive:
    """A log as calls; fitted: rows [N] that are not held out. truth [N, nx], NaN where there is none."""

    work: Plan
    fitted: NDArray[np.bool_]
    used: NDArray[np.int64]  # degrees of freedom [N, sensors] of each update
    truth: Array


class Objective:
    """Scores numbers over logs. Usable from several threads."""

    def __init__(
        self, opened: Opened, logs: Sequence[Log], holdout: float, kind: str, robust: bool, past: bool = False
    ) -> None:
        self.opened, self.spec = opened, _bare(opened.spec)
        self.kind, self.robust = kind, robust
        self.drives = [_drive(self.spec, log, holdout) for log in logs]
        self.kf = self._compiled(past or _late(self.drives))
        self.holdout = holdout
        widest = max(len(sensor.errors) for sensor in self.spec.measurements)
        self.limits = {m: chi2_quantile(OUTLIER, m) for m in range(1, 1 + widest)}
        self.pool = ThreadPoolExecutor(max_workers=os.cpu_count() or 1)
        self.trials = 0
        if kind == "rmse" and not any(np.isfinite(drive.truth).any() for drive in self.drives):
            raise KfgenError("--objective rmse compares with the truth, but no log has a column true.<state>")

    def scores(self, trials: Iterable[Sequence[float]]) -> list[Score]:
        """The scores of several trials, each a number per slot."""
        wanted = [self.opened.named(trial) for trial in trials]
        self.trials += len(wanted)
        jobs = [[self.pool.submit(self._one, numbers, drive) for drive in self.drives] for numbers in wanted]
        return [self._sum([job.result() for job in row]) for row in jobs]

    def over(self, logs: Sequence[Log]) -> Objective:
        """The same of other logs: nothing is compiled again."""
        other = object.__new__(Objective)
        other.__dict__.update(self.__dict__)
        other.drives, other.trials = [_drive(self.spec, log, self.holdout) for log in logs], 0
        if _late(other.drives) and not self.kf.struct.has_past:
            other.kf = self._compiled(True)
        return other

    def decided(self, trial: Sequence[float]) -> Objective:
        """The same with what the gates decide at a trial decided for good: what they reject there is not measured, all
        else is let in. It is smooth, and there it is as high as this one but for what the rejected ones count."""
        if not any(sensor.gate is not None for sensor in self.spec.measurements):
            return self
        numbers = self.opened.named(trial)
        drives = []
        for drive in self.drives:
            result = self._one(numbers, drive)[0]
            gated = (
                np.column_stack([result.calls[f"update_{s.name}"] & Status.GATED for s in self.spec.measurements]) != 0
            )
            work = replace(drive.work, mask=np.where(gated, 0, drive.work.mask).astype(np.uint32))
            drives.append(replace(drive, work=work, used=np.where(gated, 0, drive.used)))
        other = Objective(
            replace(self.opened, spec=_ungated(self.opened.spec)), [], self.holdout, "likelihood", self.robust,
            self.kf.struct.has_past,
        )  # fmt: skip
        other.drives = drives
        return other

    def _compiled(self, past: bool) -> NativeFilter:
        from kfgen.native import compile as compiled

        return compiled(self.spec, history=past)

    def value(self, score: Score) -> float:
        """What is to become as large as it can."""
        return score.likelihood[0] if self.kind == "likelihood" else -score.error

    def _one(self, numbers: Mapping[str, float], drive: _Drive) -> tuple[RunResult, _Drive]:
        kf = self.kf.copy()
        kf.init()
        for name, number in numbers.items():
            kf.parameters[name] = number
        if self.opened.start:
            x0, P0 = self._start(numbers)
            kf.set_state(x0)
            kf.set_covariance(P0)
        return follow(kf.struct, self.spec, drive.work), drive

    def _start(self, numbers: Mapping[str, float]) -> tuple[Array, Array]:
        from kfgen.reference.model import Model

        model = Model(replace(with_values(self.opened, numbers), scalar=DOUBLE))
        return model.x0, model.P0

    def _sum(self, runs: Sequence[tuple[RunResult, _Drive]]) -> Score:
        likelihood, squares = [0.0, 0.0], np.zeros((len(self.spec.errors), 2))
        nis: dict[str, list[float]] = {s.name: [0.0, 0.0, 0.0, 0.0] for s in self.spec.measurements}
        for result, drive in runs:
            likelihood[0] += FAILED * int(np.count_nonzero(result.calls["predict"] >= ERROR))
            for i, sensor in enumerate(self.spec.measurements):
                terms = self._terms(result, drive, i)
                some = np.isfinite(result.nis[sensor.name])
                for k, rows in enumerate((drive.fitted, ~drive.fitted)):
                    likelihood[k] += float(terms[rows].sum())
                    nis[sensor.name][k] += float(result.nis[sensor.name][rows & some].sum())
                    nis[sensor.name][k + 2] += float(drive.used[rows & some, i].sum())
            if self.kind == "rmse":
                apart = differences(self.spec, result.x[drive.fitted], drive.truth[drive.fitted])
                there = ~np.isnan(differences(self.spec, drive.truth[drive.fitted], drive.truth[drive.fitted]))
                squares += np.column_stack([np.where(there, apart**2, 0.0).sum(axis=0), there.sum(axis=0)])
        means = {name: (_ratio(a[0], a[2]), _ratio(a[1], a[3])) for name, a in nis.items()}
        known = squares[squares[:, 1] > 0]
        error = float(np.sum(0.5 * known[:, 1] * np.log(np.maximum(known[:, 0] / known[:, 1], 1e-300))))
        failures = sum(int(np.count_nonzero(result.status >= ERROR)) for result, _ in runs)
        return Score((likelihood[0], likelihood[1]), means, error - FAILED * failures)

    def _terms(self, result: RunResult, drive: _Drive, i: int) -> Array:
        """What each row [N] of a sensor adds to the log-likelihood.

        A gated innovation is no term of its filter: were it left out, a filter that gates all would be the best. It
        counts with the determinant of the last innovation that was taken. Beyond the quantile of `OUTLIER`, c, a gated
        one (with `robust` any) counts with c + (m + 1) ln(nis/c) in place of its nis, as in a Cauchy distribution's
        tail: an outlier pulls as two or three good measurements do, however far it is, and no filter gains by making
        all of them outliers.
        """
        name = self.spec.measurements[i].name
        assert result.log_likelihood is not None
        nis, m, ll = result.nis[name], drive.used[:, i], result.log_likelihood[name]
        called = m > 0
        taken = called & np.isfinite(ll)
        called &= result.calls[f"update_{name}"] & Status.TOO_OLD == 0  # it is that whatever the numbers are
        failed = called & ~np.isfinite(nis)
        terms = np.where(taken, ll, 0.0)
        terms[failed] = FAILED
        gated = called & ~taken & ~failed
        if not (gated.any() or self.robust):
            return terms
        limit = np.array([self.limits.get(int(k), math.inf) for k in m])
        with np.errstate(divide="ignore", invalid="ignore"):
            bent = np.where(nis > limit, limit + (m + 1) * np.log(nis / limit), nis)
            rest = np.where(taken, -2.0 * ll - nis, np.nan)  # m ln 2 pi + ln |S|
        if not taken.any():
            terms[gated] = FAILED
            return terms
        held = np.where(taken, np.arange(len(m)), -1)
        last = np.maximum.accumulate(held)
        last[last < 0] = int(np.argmax(taken))
        terms[gated] = -0.5 * (rest[last[gated]] + bent[gated])
        if self.robust:
            terms[taken] = -0.5 * (rest[taken] + bent[taken])
        return terms


def _late(drives: Sequence[_Drive]) -> bool:
    return any(drive.work.age.any() for drive in drives)


def _ratio(total: float, number: float) -> float:
    return total / number if number else math.nan


def _bare(spec: Spec) -> Spec:
    """What is compiled: in double, keeping its likelihood, of no budget."""
    code = replace(spec.code, log_likelihood=True, compensated=(), flash=None, ram=None, stack=None)
    return replace(spec, scalar=DOUBLE, code=code)


def _ungated(spec: Spec) -> Spec:
    """A spec whose sensors have no gates, in any mode."""

    def open_(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
        return tuple(replace(sensor, gate=None) for sensor in sensors)

    imm = spec.imm
    if imm is not None:
        imm = replace(imm, modes=tuple(replace(mode, measurements=open_(mode.measurements)) for mode in imm.modes))
    return replace(spec, measurements=open_(spec.measurements), imm=imm)


def _drive(spec: Spec, log: Log, holdout: float) -> _Drive:
    work = plan(spec, log, fixed_step(spec))
    fitted = np.arange(log.rows) < round((1.0 - holdout) * log.rows)
    used = np.array([
        [degrees_of(sensor, bits) for sensor, bits in zip(spec.measurements, row, strict=True)]
        for row in work.mask.tolist()
    ], dtype=np.int64).reshape(log.rows, len(spec.measurements))  # fmt: skip
    row, sensor = np.nonzero(work.mask)
    bits = work.mask[row, sensor]
    setting, waiting = firsts(spec, sensor, bits, np.ones(len(row), bool))
    used[row[setting | waiting], sensor[setting | waiting]] = 0
    absent = np.full(log.rows, np.nan)
    truth = np.column_stack([log.columns.get(f"true.{state.name}", absent) for state in spec.states])
    return _Drive(work, fitted, used, truth)
