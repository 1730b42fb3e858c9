"""The interacting multiple model: a bank of filters of one state, between which a Markov chain switches.

Blom & Bar-Shalom 1988; Bar-Shalom, Li & Kirubarajan 2001, section 11.6.6. Mixing belongs to predict, weighing to
update: so that several updates between two predicts, and several predicts in a row, are right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from kfgen.reference.algorithm import Algorithm, Correction, Estimate, Estimator, Innovation
from kfgen.reference.dual import Matrix, Vector, value_of
from kfgen.reference.mixing import mixing, moments, transition_rows, weighed
from kfgen.reference.model import Context
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError
from kfgen.spec.types import Imm

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class BankEstimate(Estimate):
    """x, P: the combined estimate. mu (B): the probabilities of the modes. modes: their estimates."""

    mu: Vector
    modes: tuple[Estimate, ...]


class Bank(Estimator):
    """The filters of the modes. What all have in common is read from the first.

    Mixing leaves to each mode the noise covariances it has learnt, and drops what belongs to its x and P alone.
    """

    def __init__(self, imm: Imm, algorithms: Sequence[Algorithm]) -> None:
        self.algorithms = tuple(algorithms)
        self.model = self.algorithms[0].model
        self.sensors = dict(self.algorithms[0].sensors)
        for name, sensor in self.sensors.items():
            sensor.takes_inputs = any(algorithm.sensors[name].takes_inputs for algorithm in self.algorithms)
        self.options = tuple(option for algorithm in self.algorithms for option in algorithm.options)
        compiled, number = self.model.scope.compile, self.model.number
        self._transition = [[compiled(entry) for entry in row] for row in imm.transition]
        mu0 = np.array([number(entry) for entry in imm.mu0])
        self._mu0 = mu0 / np.sum(mu0)
        self._floor = number(imm.mu_floor)

    def initial(self) -> BankEstimate:
        return self._combined(self._mu0, [algorithm.initial() for algorithm in self.algorithms])

    # --- steps

    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """All mixed, then each predicted; mu <- c, normalised. A mode that cannot be the present one (c_j = 0)
        starts from its own estimate."""
        bank = _bank(estimate)
        w, c = mixing(self._rows(bank, context), bank.mu)
        mixed = [self._mixed(bank, j, w[:, j]) if c[j] > 0.0 else bank.modes[j] for j in range(len(c))]
        steps = _each(
            partial(algorithm.predict, start, context) for algorithm, start in zip(self.algorithms, mixed, strict=True)
        )
        flags = _joined(warnings for _, warnings in steps)
        return self._stored(c / np.sum(c), [after for after, _ in steps]), flags

    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """The innovations of all modes; nis is the smallest of theirs."""
        found = _each(
            partial(algorithm.of(reading.sensor.name).innovate, mode, _own(algorithm, reading))
            for algorithm, mode in zip(self.algorithms, _bank(estimate).modes, strict=True)
        )
        return Innovation(min(innovation.nis for innovation in found), tuple(found))

    def nis_of_modes(self, innovation: Innovation) -> tuple[float, ...]:
        return tuple(part.nis for part in _innovations(innovation))

    def judge(self, innovation: Innovation, reading: Reading, rejected: int) -> Status:
        """The most willing mode decides for all of them.

        A mode that left out a reading which others take would have no likelihood of it to be weighed by. One that
        the reading contradicts takes it, and loses its probability.
        """
        parts = zip(self.algorithms, _innovations(innovation), strict=True)
        verdicts = [algorithm.judge(part, _own(algorithm, reading), rejected) for algorithm, part in parts]
        return next(verdict for verdict in (Status.OK, Status.ANOMALY, Status.GATED) if verdict in verdicts)

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """Each mode updated, and weighed by its likelihood."""
        bank = _bank(estimate)
        made = _each(
            partial(algorithm.of(reading.sensor.name).correct, mode, _own(algorithm, reading), part)
            for algorithm, mode, part in zip(self.algorithms, bank.modes, _innovations(innovation), strict=True)
        )
        mu, log_likelihood = weighed(bank.mu, np.array([one.log_likelihood for one in made]), self._floor)
        stored = self._stored(mu, [one.estimate for one in made])
        return Correction(stored, log_likelihood, _joined(one.flags for one in made))

    # --- setting

    def placed(self, estimate: Estimate, change: Callable[[Vector], Vector]) -> Estimate:
        """mu stays."""
        return self._changed(estimate, lambda algorithm, mode: algorithm.placed(mode, change))

    def with_covariance(self, estimate: Estimate, P: Matrix) -> Estimate:
        """mu stays; where the modes differ in x the combined covariance is P and their spread."""
        return self._changed(estimate, lambda algorithm, mode: algorithm.with_covariance(mode, P))

    def respread(self, estimate: Estimate, change: Callable[[Matrix], Matrix]) -> Estimate:
        """mu stays."""
        return self._changed(estimate, lambda algorithm, mode: algorithm.respread(mode, change))

    def reweighed(self, estimate: Estimate, mu: Vector) -> Estimate:
        """With other probabilities (B) of the modes."""
        return self._combined(mu / np.sum(mu), _bank(estimate).modes)

    def redrawn(self, estimate: Estimate) -> Estimate:
        return self._changed(estimate, lambda algorithm, mode: algorithm.redrawn(mode))

    def _changed(self, estimate: Estimate, change: Callable[[Algorithm, Estimate], Estimate]) -> BankEstimate:
        bank = _bank(estimate)
        return self._combined(bank.mu, [change(a, mode) for a, mode in zip(self.algorithms, bank.modes, strict=True)])

    # --- mixtures

    def _rows(self, bank: BankEstimate, context: Context) -> Matrix:
        """The transition matrix (B, B) of a step. Raises StepError NOT_FINITE, NOT_POSITIVE."""
        environment = self.model.environment(context, bank.x)
        return transition_rows(np.array([[value_of(entry(environment)) for entry in row] for row in self._transition]))

    def _mixed(self, bank: BankEstimate, j: int, w: Vector) -> Estimate:
        """What mode j starts a step from. Raises StepError NOT_FINITE."""
        x, P = moments(self.model, bank.modes, w)
        _require_finite(x, P)
        return replace(bank.modes[j], x=x, P=P, memory=None)

    def _stored(self, mu: Vector, modes: Sequence[Estimate]) -> BankEstimate:
        """What a step stores. Raises StepError NOT_FINITE.

        The modes are within the bounds of the states; what mixes them leaves these by a rounding at most.
        """
        combined = self._combined(mu, modes)
        _require_finite(combined.x, combined.P)
        return replace(combined, x=self.model.wrap(self.model.clip(combined.x)))

    def _combined(self, mu: Vector, modes: Sequence[Estimate]) -> BankEstimate:
        x, P = moments(self.model, modes, mu)
        return BankEstimate(x, P, mu=mu, modes=tuple(modes))


def _bank(estimate: Estimate) -> BankEstimate:
    assert isinstance(estimate, BankEstimate)
    return estimate


def _innovations(innovation: Innovation) -> tuple[Innovation, ...]:
    assert isinstance(innovation.detail, tuple)
    return innovation.detail


def _own(algorithm: Algorithm, reading: Reading) -> Reading:
    """The reading as a mode's own sensor has it."""
    return replace(reading, sensor=algorithm.sensors[reading.sensor.name])


def _joined(flags: Iterable[Status]) -> Status:
    every = Status.OK
    for each in flags:
        every |= each
    return every


def _each(calls: Iterable[Callable[[], T]]) -> list[T]:
    """The results of all calls. Where some raise, the first of the error bits counts, not the first of the modes."""
    results, errors = [], []
    for call in calls:
        try:
            results.append(call())
        except StepError as error:
            errors.append(error.status)
        except np.linalg.LinAlgError:  # numbers near the end of their range
            errors.append(Status.NOT_FINITE)
    if errors:
        raise StepError(min(errors))
    return results


def _require_finite(x: Vector, P: Matrix) -> None:
    if not (np.isfinite(x).all() and np.isfinite(P).all()):
        raise StepError(Status.NOT_FINITE)
