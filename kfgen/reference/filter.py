"""The reference filter: the interface of a compiled filter around a dense textbook algorithm."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from kfgen.reference.algorithm import Correction, Estimate, Estimator
from kfgen.reference.arguments import components_used, own_inputs
from kfgen.reference.clock import Clock, step_of
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.first import Firsts
from kfgen.reference.linalg import lower_root, udu
from kfgen.reference.log import Run, replay
from kfgen.reference.mode import ModeView, is_root, keeps_points
from kfgen.reference.model import Context, Model, fixed_step
from kfgen.reference.outputs import Outputs
from kfgen.reference.parameters import Parameters
from kfgen.reference.reading import Read
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError
from kfgen.spec.types import Filter, Spec


class ReferenceFilter:
    """One filter, in float64 and physical units.

    Attributes (arrays are copies):
        x (nx), P (n, n): the estimate, in the spec's order of the states; of a quaternion P has three errors.
        estimate: with what else is kept of it.
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
        self._outputs = Outputs(self.model)
        self._firsts = Firsts(self.model, spec.initialize, self.sensors)
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
        self._require("sqrt_covariance", self._any(is_root), "covariance: sqrt")
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
    def outputs(self) -> dict[str, float]:
        """The spec's outputs at x, by name."""
        self._require("outputs", bool(self.spec.outputs), "outputs")
        return self._outputs.values(self._estimate, self.now)

    @property
    def output_std(self) -> dict[str, float]:
        """Their standard deviations, to first order."""
        self._require("output_std", bool(self.spec.outputs), "outputs")
        return self._outputs.deviations(self._estimate, self.now)

    @property
    def now(self) -> Context:
        """What an output is told beside the estimate."""
        step = math.nan if self._fixed is None else float(self._fixed)
        return Context(self.parameters, np.zeros(len(self.model.inputs)), self._clock.now, step)

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
        self._firsts.begin()
        return int(Status.OK)

    def set_state(self, x: ArrayLike) -> int:
        """Sets x (nx), wrapped, quaternions normalised; NOT_FINITE, and NOT_POSITIVE for a quaternion with a norm below
        1e-3, leave the filter as it was."""
        new = np.array(x, dtype=np.float64).reshape(self.model.nx)
        try:
            self.model.space.judge(new)
        except StepError as error:
            return int(error.status)
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
        self._require("set_sqrt_covariance", self._any(is_root), "covariance: sqrt")
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
        self._require("redraw", self._any(keeps_points), "redraw: false")
        self._estimate = self.algorithm.redrawn(self._estimate)
        return int(Status.OK)

    def predict(self, u: ArrayLike | None = None, dt: float | None = None) -> int:
        """One step: u (nu) where the spec has inputs, dt in s where the step is an argument."""
        inputs = self._inputs(u, needed=bool(self.model.inputs))
        if self._step.run_time and dt is None:
            raise TypeError("predict: this filter takes dt")
        if self._firsts.wait:
            return int(Status.OK)
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
        self, sensor: str, z: ArrayLike, u: ArrayLike | None = None, mask: int | Sequence[bool] | None = None,
        inputs: ArrayLike | Mapping[str, float] | None = None,
    ) -> int:  # fmt: skip
        """An update with z (m); u (nu) where the sensor takes inputs; mask: bit i for component i; inputs: the
        sensor's own, in order or by name, where it has some."""
        model = self.sensors[sensor]
        measured = np.array(z, dtype=np.float64).reshape(model.m)
        given, own = self._inputs(u, needed=model.takes_inputs), own_inputs(model, inputs)
        used = components_used(model, mask)
        if not used or self._firsts.hold(sensor):
            return int(Status.OK)
        reading = Reading(model, measured, used, Context(self.parameters, given, self._clock.now, 0.0, own))
        try:
            first = self._firsts.of(reading)
            read = self._read.update(sensor, used) | (first.read if first is not None else frozenset())
            self._test(read, given, dict(zip(model.own, own.tolist(), strict=True)))
            reading.space.judge(measured[list(used)])
            if first is not None:
                self._estimate = first.apply(self.algorithm, self._estimate, reading)
                self._firsts.come(sensor)
                self.nis = 0.0
                return int(Status.OK)
            if self._firsts.wait:
                return int(Status.OK)
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

    def _test(self, read: frozenset[str], inputs: Vector, own: Mapping[str, float] | None = None) -> None:
        """Raises NOT_FINITE for an input or a parameter that is read and is not finite. own: a sensor's inputs."""
        given = {**dict(zip(self.model.inputs, map(float, inputs), strict=True)), **self.parameters, **(own or {})}
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
