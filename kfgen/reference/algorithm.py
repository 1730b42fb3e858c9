"""What a filter type has to provide, and what all of them do with a new estimate.

An Estimator holds no state of its own: it maps estimates to estimates, so that a filter (or a bank of them)
can drop a result and be what it was before.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from kfgen.reference.adapt import NOTHING, Adaptation, Adapted
from kfgen.reference.dual import Matrix, Vector, value_of
from kfgen.reference.evaluate import Closure
from kfgen.reference.gates import Gates
from kfgen.reference.linalg import EPS
from kfgen.reference.model import Context, Model
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.reference.status import Status, StepError
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Expression
from kfgen.spec.types import Filter


@dataclass(frozen=True)
class Estimate:
    """x (n), P (n, n), and whatever else the algorithm keeps between two steps.

    memory: what belongs to this very x and P, and is dropped when either is set. adapted: noise covariances
    learnt so far, which outlast that.
    """

    x: Vector
    P: Matrix
    memory: object = None
    adapted: Adapted = NOTHING


@dataclass(frozen=True)
class Innovation:
    """What is known of an update before the gate: nis, and (for `correct`) whatever the algorithm wants."""

    nis: float
    detail: object = None


@dataclass(frozen=True)
class Correction:
    """An update as made. log_likelihood is that of the innovations and variances it used."""

    estimate: Estimate
    log_likelihood: float
    flags: Status = Status.OK


class Estimator(ABC):
    """A filter type, or a bank of them. Its steps raise StepError, or return finite, wrapped, bounded estimates.

    Attributes: model; sensors: by name, in the spec's order; options: of the filter, or of each of a bank;
    fixed_covariance: whether P never changes, and so cannot be set.
    """

    model: Model
    sensors: Mapping[str, SensorModel]
    options: tuple[Filter, ...]
    fixed_covariance = False

    def of(self, sensor: str) -> Estimator:
        """The same with the options of one sensor, for its updates."""
        return self

    @abstractmethod
    def initial(self) -> Estimate:
        """The estimate after init."""

    @abstractmethod
    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """The estimate one step later, and warnings."""

    @abstractmethod
    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """The innovation of a reading, by the plain residual and covariance: what the gate judges."""

    def nis_of_modes(self, innovation: Innovation) -> tuple[float, ...]:
        """The nis of each filter of a bank."""
        return (innovation.nis,)

    @abstractmethod
    def judge(self, innovation: Innovation, reading: Reading, rejected: int) -> Status:
        """What the gate says of a reading, `rejected` of whose sensor were in a row: see Gates.judge."""

    @abstractmethod
    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """The update with a reading that has passed the gate."""

    @abstractmethod
    def placed(self, estimate: Estimate, change: Callable[[Vector], Vector]) -> Estimate:
        """The estimate with x (n), or the x of every filter of a bank, changed; the covariance stays."""

    @abstractmethod
    def with_covariance(self, estimate: Estimate, P: Matrix) -> Estimate:
        """The estimate with P (n, n) for its covariance, or for that of every filter of a bank; x stays."""

    @abstractmethod
    def redrawn(self, estimate: Estimate) -> Estimate:
        """The estimate without the points kept for an update, which then draws its own."""


class Algorithm(Estimator):
    """A filter type."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.sensors = {sensor.name: SensorModel(model, sensor) for sensor in model.spec.measurements}
        self.options = (model.spec.filter,)
        self.limits = Limits(model)
        self.adaptation = Adaptation(model)
        self._gates = Gates(model)
        self._own: dict[str, Algorithm] = {}
        for sensor in model.spec.measurements:
            if sensor.own:
                others = tuple(replace(each, own={}) for each in model.spec.measurements)
                chosen = filter_of(model.spec.filter, sensor)
                self._own[sensor.name] = type(self)(Model(replace(model.spec, filter=chosen, measurements=others)))

    def of(self, sensor: str) -> Algorithm:
        return self._own.get(sensor, self)

    def initial(self) -> Estimate:
        return Estimate(self.model.x0, self.model.P0, adapted=self.adaptation.initial())

    def judge(self, innovation: Innovation, reading: Reading, rejected: int) -> Status:
        return self._gates.judge(reading, innovation.nis, rejected)

    def placed(self, estimate: Estimate, change: Callable[[Vector], Vector]) -> Estimate:
        return replace(estimate, x=change(estimate.x), memory=None)

    def with_covariance(self, estimate: Estimate, P: Matrix) -> Estimate:
        return replace(estimate, P=P, memory=None)

    def redrawn(self, estimate: Estimate) -> Estimate:
        return replace(estimate, memory=None)


class Limits:
    """Floor, ceiling, bounds, wrapping and guards, in this order: the end of every step."""

    def __init__(self, model: Model) -> None:
        options = model.spec.filter
        self.model = model
        self._floor = self._compile(options.variance_floor)
        self._ceiling = self._compile(options.variance_ceiling)

    def _compile(self, entries: Mapping[str, Expression]) -> dict[int, Closure]:
        return {self.model.index[name]: self.model.scope.compile(entry) for name, entry in entries.items()}

    def finish(self, x: Vector, P: Matrix, context: Context) -> tuple[Vector, Matrix, Status]:
        """The x (n) and P (n, n) that a step stores; REGULARIZED where a variance met its floor or ceiling.

        Raises StepError NOT_FINITE.
        """
        if not (np.isfinite(x).all() and np.isfinite(P).all()):
            raise StepError(Status.NOT_FINITE)
        flags = Status.OK
        if self._floor or self._ceiling:
            environment = self.model.environment(context, x)
            floor, ceiling = np.zeros(self.model.n), np.full(self.model.n, np.inf)
            for i, closure in self._floor.items():
                floor[i] = value_of(closure(environment))
            for i, closure in self._ceiling.items():
                ceiling[i] = value_of(closure(environment))
            P, changed = _limited(P, floor, ceiling)
            flags = Status.REGULARIZED if changed else flags
        return self.model.wrap(self.model.clip(x)), P, flags


def _limited(P: Matrix, floor: Vector, ceiling: Vector) -> tuple[Matrix, bool]:
    """P_ii raised to the floor; where it then exceeds the ceiling its row and column are scaled to it.

    A variance that a factored form may have left a rounding beyond a limit is not beyond it.
    """
    room = 4.0 * len(P) * EPS
    raised = np.where(P.diagonal() < floor * (1.0 - room), floor, P.diagonal())
    above = raised > ceiling * (1.0 + room)
    if np.array_equal(raised, P.diagonal()) and not np.any(above):
        return P, False
    P = P.copy()
    np.fill_diagonal(P, raised)
    scale = np.ones(len(P))
    scale[above] = np.sqrt(ceiling[above] / raised[above])
    return P * np.outer(scale, scale), True
