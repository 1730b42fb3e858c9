"""The reference filter: the interface of a compiled filter around a dense textbook algorithm."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from kfgen.reference.algorithm import Correction, Estimate, Estimator
from kfgen.reference.clock import Clock, step_of
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import lower_root, udu
from kfgen.reference.log import Run, replay
from kfgen.reference.mode import ModeView
from kfgen.reference.model import Context, Model, fixed_step
from kfgen.reference.parameters import Parameters
from kfgen.reference.reading import Read
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.reference.status import Status, StepError
from kfgen.spec.types import Filter, Spec


class ReferenceFilter:
    """One filter, in float64 and physical units.

    Attributes (arrays are copies):
        x (n), P (n, n): the estimate, in the spec's order of the states; estimate: with what else is kept of it.
        nis: normalised innovation squared of the last update, also of a gated one; 0 after init.
        log_likelihood: of the last update that was made.
        t: seconds since init.
        parameters: name -> value, changeable; back at the spec's values after init.
        gate_count: sensor -> rejections in a row.
        R: sensor -> (m, m), Q (n, n): the adapted noise covariances (`adapt_R`, `adapt_Q` only).
        sqrt_covariance (n, n): the lower Cholesky factor of P (`covariance: sqrt` only).
    Steps return the status bits as an int and never raise for what the filter meets; a call of the wrong
    shape (a missing u, an unknown sensor) raises TypeError, ValueError or KeyError.
    """

    def __init__(self, spec: Spec, algorithm: Estimator) -> None:
        self.spec = spec
        self.model: Model = algorithm.model
        self.algorithm = algorithm
        self.sensors = algorithm.sensors
        self._step = step_of(spec, self.model.number)
        self._fixed = fixed_step(spec)
        self._read = Read(spec)
        self.init()

    @property
    def x(self) -> Vector:
        return self._estimate.x.copy()

    @property
    def P(self) -> Matrix:
        return self._estimate.P.copy()

    @property
    def estimate(self) -> Estimate:
        return self._estimate

    @property
    def sqrt_covariance(self) -> Matrix:
        self._require("sqrt_covariance", self._any(_is_root), "covariance: sqrt")
        return lower_root(self._estimate.P)

    @property
    def R(self) -> dict[str, Matrix]:
        R = self._estimate.adapted.R
        self._require("R", bool(R), "adapt_R")
        return {name: matrix.copy() for name, matrix in R.items()}

    @property
    def Q(self) -> Matrix:
        Q = self._estimate.adapted.Q
        self._require("Q", Q is not None, "adapt_Q")
        assert Q is not None
        return Q.copy()

    @property
    def mu(self) -> Vector:
        """The probabilities (B) of the modes of an imm."""
        raise self._missing("mu", "imm")

    @mu.setter
    def mu(self, mu: Vector) -> None:
        raise self._missing("mu", "imm")

    @property
    def modes(self) -> tuple[ModeView, ...]:
        """The modes of an imm, in the spec's order."""
        raise self._missing("modes", "imm")

    @property
    def t(self) -> float:
        return self._clock.now

    def _any(self, holds: Callable[[Filter], bool]) -> bool:
        """Whether a condition holds for the filter's options, or for those of one of a bank."""
        return any(map(holds, self.algorithm.options))

    def _require(self, what: str, there: bool, option: str) -> None:
        if not there:
            raise self._missing(what, option)

    def _missing(self, what: str, option: str) -> AttributeError:
        return AttributeError(f"filter {self.spec.name} has no {what}; its spec has no `{option}`")

    def _require_variable(self) -> None:
        if self.algorithm.fixed_covariance:
            raise AttributeError(f"filter {self.spec.name} has a fixed covariance; its spec has `gain: steady`")

    def init(self) -> int:
        """Back to the spec: estimate, parameters, time, counters."""
        self._estimate = self.algorithm.initial()
        self.parameters = Parameters(self.model.values)
        # without a dt the spec has no seconds: t then counts steps
        self._clock = Clock(Fraction(1) if self.spec.dt is None else self._fixed)
        self.nis = 0.0
        self.nis_of_modes = (0.0,) * len(self.algorithm.options)
        self.log_likelihood = 0.0
        self.gate_count = dict.fromkeys(self.sensors, 0)
        self._uninitialised = self.spec.initialize is not None
        return int(Status.OK)

    def set_state(self, x: ArrayLike) -> int:
        """Sets x (n), wrapped; NOT_FINITE leaves the filter as it was."""
        new = np.array(x, dtype=np.float64).reshape(self.model.n)
        if not np.isfinite(new).all():
            return int(Status.NOT_FINITE)
        self._estimate = self.algorithm.placed(self._estimate, lambda x: self.model.wrap(new))
        return int(Status.OK)

    def displace(self, change: Callable[[Vector], Vector]) -> None:
        """x <- change(x), of every mode of a bank; as set_state, the covariance stays."""
        self._estimate = self.algorithm.placed(self._estimate, lambda x: self.model.wrap(change(x)))

    def set_covariance(self, P: ArrayLike) -> int:
        """Sets P (n, n) from its upper triangle; NOT_FINITE and NOT_POSITIVE leave the filter as it was."""
        self._require_variable()
        given = np.array(P, dtype=np.float64).reshape(self.model.n, self.model.n)
        new = np.triu(given) + np.triu(given, 1).T
        try:
            if not np.isfinite(new).all():
                raise StepError(Status.NOT_FINITE)
            with np.errstate(all="ignore"):
                U, D = udu(new, computed=False)
        except StepError as error:
            return int(error.status)
        if np.any(D == 0.0):
            # a pivot that is negative or positive only by rounding is the zero it stands for
            new = (U * D) @ U.T
        self._estimate = self.algorithm.with_covariance(self._estimate, new)
        return int(Status.OK)

    def set_sqrt_covariance(self, S: ArrayLike) -> int:
        """Sets P = S S^T from the lower triangle of S (n, n) (`covariance: sqrt` only).

        NOT_FINITE leaves the filter as it was. The sign of a column makes no difference to P.
        """
        self._require("set_sqrt_covariance", self._any(_is_root), "covariance: sqrt")
        self._require_variable()
        root = np.tril(np.array(S, dtype=np.float64).reshape(self.model.n, self.model.n))
        with np.errstate(all="ignore"):
            new = root @ root.T
        if not np.isfinite(new).all():
            return int(Status.NOT_FINITE)
        self._estimate = self.algorithm.with_covariance(self._estimate, new)
        return int(Status.OK)

    def redraw(self) -> int:
        """Draws the points that predict has kept for an update anew, from x and P (`redraw: false` only)."""
        self._require("redraw", self._any(_keeps_points), "redraw: false")
        self._estimate = self.algorithm.redrawn(self._estimate)
        return int(Status.OK)

    def predict(self, u: ArrayLike | None = None, dt: float | None = None) -> int:
        """One step: u (nu) where the spec has inputs, dt in s where the step is an argument."""
        inputs = self._inputs(u, needed=bool(self.model.inputs))
        if self._step.run_time and dt is None:
            raise TypeError("predict: this filter takes dt")
        try:
            step, flags = self._step.nominal, Status.OK
            self._test(self._read.predict, inputs)
            if dt is not None and not math.isfinite(dt):
                raise StepError(Status.NOT_FINITE)
            if self._step.run_time and dt is not None:
                step, flags = self._step.clamped(float(dt))
            context = Context(self.parameters, inputs, self._clock.now, step)
            with np.errstate(all="ignore"):
                estimate, warnings = self.algorithm.predict(self._estimate, context)
        except StepError as error:
            return int(error.status)
        except np.linalg.LinAlgError:  # numbers near the end of their range
            return int(Status.NOT_FINITE)
        self._estimate, self._clock = estimate, self._clock.advanced(step)
        return int(flags | warnings)

    def update(
        self, sensor: str, z: ArrayLike, u: ArrayLike | None = None, mask: int | Sequence[bool] | None = None
    ) -> int:
        """An update with z (m); u (nu) where the sensor takes inputs; mask: bit i for component i."""
        model = self.sensors[sensor]
        measured = np.array(z, dtype=np.float64).reshape(model.m)
        inputs = self._inputs(u, needed=model.takes_inputs)
        used = _used(model, mask)
        if not used:
            return int(Status.OK)
        reading = Reading(model, measured, used, Context(self.parameters, inputs, self._clock.now, 0.0))
        try:
            self._test(self._read.update(sensor, used), inputs)
            if not np.isfinite(measured[list(used)]).all():
                raise StepError(Status.NOT_FINITE)
            if self._initialises(reading):
                return int(self._initialise(reading))
            with np.errstate(all="ignore"):
                return int(self._judge(reading))
        except StepError as error:
            return int(error.status)
        except np.linalg.LinAlgError:  # numbers near the end of their range
            return int(Status.NOT_FINITE)

    def run(self, log: Mapping[str, ArrayLike]) -> Run:
        """Replays a log from the filter's present state: see kfgen.reference.log.replay."""
        return replay(self, log)

    def _inputs(self, u: ArrayLike | None, needed: bool) -> Vector:
        if u is None:
            if needed:
                raise TypeError(f"this filter takes u: {', '.join(self.model.inputs)}")
            return np.zeros(len(self.model.inputs))
        return np.array(u, dtype=np.float64).reshape(len(self.model.inputs))

    def _test(self, read: frozenset[str], inputs: Vector) -> None:
        """Raises NOT_FINITE for an input or a parameter that is read and is not finite."""
        given = {**dict(zip(self.model.inputs, map(float, inputs), strict=True)), **self.parameters}
        if not all(math.isfinite(value) for name, value in given.items() if name in read):
            raise StepError(Status.NOT_FINITE)

    def _judge(self, reading: Reading) -> Status:
        """An update behind the gate: the whole vector, or nothing of it."""
        name = reading.sensor.name
        algorithm = self.algorithm.of(name)
        innovation = algorithm.innovate(self._estimate, reading)
        verdict = self.algorithm.judge(innovation, reading, self.gate_count[name])
        if verdict == Status.GATED:
            self.nis = innovation.nis
            self.gate_count[name] += 1
            return verdict
        correction: Correction = algorithm.correct(self._estimate, reading, innovation)
        self._estimate = correction.estimate
        self.nis, self.log_likelihood = innovation.nis, correction.log_likelihood
        self.nis_of_modes = self.algorithm.nis_of_modes(innovation)
        self.gate_count[name] = 0
        return verdict | correction.flags

    def _initialises(self, reading: Reading) -> bool:
        """Whether this reading is the first one of the sensor that sets the initial states."""
        rule = self.spec.initialize
        if rule is None or not self._uninitialised or rule.sensor != reading.sensor.name:
            return False
        return all(reading.sensor.components.index(each) in reading.used for each in rule.states.values())

    def _initialise(self, reading: Reading) -> Status:
        """Sets the states that the spec names from the reading; the covariance stays, no update is made."""
        rule = self.spec.initialize
        assert rule is not None
        components = reading.sensor.components
        entries = {self.model.index[state]: components.index(component) for state, component in rule.states.items()}

        def change(x: Vector) -> Vector:
            x = x.copy()
            x[list(entries)] = reading.z[list(entries.values())]
            return self.model.wrap(self.model.clip(x))

        self._estimate = self.algorithm.placed(self._estimate, change)
        self._uninitialised = False
        self.nis = 0.0
        return Status.OK


def _is_root(options: Filter) -> bool:
    return options.covariance == "sqrt"


def _keeps_points(options: Filter) -> bool:
    return options.sigma_points is not None and not options.sigma_points.redraw


def _used(sensor: SensorModel, mask: int | Sequence[bool] | None) -> tuple[int, ...]:
    """The components that a mask selects; all without one."""
    if mask is None:
        return tuple(range(sensor.m))
    if not sensor.partial:
        raise TypeError(f"sensor {sensor.name} takes no mask")
    if isinstance(mask, int | np.integer):
        return tuple(i for i in range(sensor.m) if int(mask) >> i & 1)
    return tuple(i for i, bit in enumerate(mask) if bit)
