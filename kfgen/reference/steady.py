"""The Kalman filter with its steady-state gain (Bar-Shalom, Li & Kirubarajan 2001, section 5.2.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError, block_diag, solve_discrete_are

from kfgen.errors import SpecError
from kfgen.reference.algorithm import Correction, Estimate, Innovation, Passage
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.ekf import Ekf
from kfgen.reference.joseph import Update, update
from kfgen.reference.linalg import EPS, symmetric
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Transition
from kfgen.reference.sensor import Linearisation, Reading, SensorModel
from kfgen.reference.status import Status, StepError

# Steps that the recursion of the covariance is given to settle, from P0 and from the solution of the Riccati
# equation; the change of a correlation at rest; the part of an initial variance that may be rounding.
_MOST_STEPS, _POLISHING = 5000, 200
_AT_REST = 1e-13
_NOTHING = 1e-12
# the largest factor by which an error may decay in a cycle: what decays more slowly does not within float64
_DECAYS = 1.0 - 1e-9


@dataclass(frozen=True)
class Turn:
    """A sensor's place in the cycle: P (n, n) before its update, its H (m, n) and R (m, m)."""

    P: Matrix
    H: Matrix
    R: Matrix


class Steady(Ekf):
    """A cycle is a predict and an update of every sensor in the spec's order. Each sensor has the gain of its
    place in the cycle, whenever its measurements come.

    The covariance before the first sensor solves the discrete Riccati equation of all sensors together. With
    options that change an update (consider, gain_limit, innovation_floor) or limit the covariance there is no
    such equation: it is then the limit that the filter's own covariance takes from P0 on.
    """

    fixed_covariance = True

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        sensors = [SensorModel(model, sensor) for sensor in model.spec.measurements]
        self._transition, linear = self._constants(sensors)
        self._names = [sensor.name for sensor in sensors]
        self._H, self._R = [each.H for each in linear], [each.R for each in linear]
        context = Context(model.values, np.zeros(len(model.inputs)), 0.0, 0.0)
        self._rules, self._context = self.treatment.rules(context), context
        options = model.spec.filter
        own = self.treatment.trivial and not options.variance_floor and not options.variance_ceiling
        try:
            with np.errstate(all="ignore"):
                P = self._riccati() if own else self._settled(model.P0, _MOST_STEPS)
                turns, after = self._cycle(P)
        except StepError:
            raise self._refusal("the covariance does not stay one") from None
        self.turns = dict(zip(self._names, turns, strict=True))
        self._after = after

    def initial(self) -> Estimate:
        return replace(super().initial(), P=self._after)

    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """x <- f(x, u)."""
        transition = self.process.linearise(estimate.x, context)
        x = self._finish(transition.x)
        before_first = next(iter(self.turns.values())).P
        passage = Passage(x, before_first, self._after @ transition.F.T)
        return replace(estimate, x=x, passage=passage), Status.OK

    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """y = z - h(x); nis by the constant S."""
        h = reading.sensor.linearise(estimate.x, reading).h
        y = reading.sensor.innovation(h, estimate.x, reading)
        turn = self.turns[reading.sensor.name]
        nis = update(turn.P, turn.H, turn.R, y, self.treatment.plain).nis
        if not math.isfinite(nis):
            raise StepError(Status.NOT_FINITE)
        return Innovation(nis, y)

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """x <- x + K y."""
        y = innovation.detail
        assert isinstance(y, np.ndarray)
        turn = self.turns[reading.sensor.name]
        result = update(turn.P, turn.H, turn.R, y, self._rules)
        x = self._finish(estimate.x + result.dx)
        return Correction(replace(estimate, x=x), result.log_likelihood, result.flags)

    def _finish(self, x: Vector) -> Vector:
        if not np.isfinite(x).all():
            raise StepError(Status.NOT_FINITE)
        return self.model.wrap(self.model.clip(x))

    def _constants(self, sensors: list[SensorModel]) -> tuple[Transition, list[Linearisation]]:
        """F, Q, H and R, which are the same everywhere, where the rest of the formulas has values."""
        model, spec = self.model, self.model.spec
        dt = 1.0 if spec.dt is None else model.number(spec.dt.nominal)
        for at in (0.0, 1.0):
            x, u = np.full(model.n, at), np.full(len(model.inputs), at)
            now, context = Context(model.values, u, at, 0.0), Context(model.values, u, at, dt)
            try:
                with np.errstate(all="ignore"):
                    given = [replace(now, own=np.full(len(s.own), at)) for s in sensors]
                    pairs = zip(sensors, given, strict=True)
                    readings = [Reading(s, np.zeros(s.m), tuple(range(s.m)), each) for s, each in pairs]
                    linear = [each.sensor.linearise(x, each) for each in readings]
                    return self.process.linearise(x, context), linear
            except StepError:
                continue
        raise self._refusal("the model has no finite values")

    def _cycle(self, P: Matrix) -> tuple[list[Turn], Matrix]:
        """The turns of all sensors, from the covariance before the first of them; and that after the last."""
        turns = []
        for H, R in zip(self._H, self._R, strict=True):
            turns.append(Turn(P, H, R))
            P = self._limited(self._updated(turns[-1], np.zeros(len(R))).P)
        return turns, P

    def _updated(self, turn: Turn, y: Vector) -> Update:
        return update(turn.P, turn.H, turn.R, y, self._rules)

    def _limited(self, P: Matrix) -> Matrix:
        return self.limits.finish(np.zeros(self.model.n), P, self._context)[1]

    def _next(self, P: Matrix) -> Matrix:
        """The covariance before the first sensor, one cycle later."""
        F = self._transition.F
        return self._limited(symmetric(F @ self._cycle(P)[1] @ F.T + self._transition.Q))

    def _riccati(self) -> Matrix:
        """The stabilising solution for the covariance before the first sensor.

        A state whose noise dies out has a variance of 0, for which the equation's solver gives some rounding;
        and a singular R can leave the solver without a solution, though the covariance settles.
        """
        F, Q, P0 = self._transition.F, self._transition.Q, self.model.P0
        starts = [(P0, _MOST_STEPS)]
        try:
            solution = solve_discrete_are(F.T, np.vstack(self._H).T, Q, block_diag(*self._R))
            P = symmetric(np.asarray(solution, np.float64))
        except (LinAlgError, ValueError):
            pass
        else:
            some = P.diagonal() > _NOTHING * P0.diagonal()
            starts = [(P, _POLISHING), (P * np.outer(some, some), _POLISHING), *starts]
        for start, steps in starts:
            try:
                P = self._settled(start, steps)
                if np.max(np.abs(np.linalg.eigvals(self._error_transition(P)))) < _DECAYS:
                    return P
                why = "no gain makes the estimation error decay"
            except (SpecError, StepError):
                why = "the covariance does not come to rest"
        raise self._refusal(why)

    def _settled(self, P: Matrix, steps: int) -> Matrix:
        """Where the recursion of the covariance comes to rest."""
        for _ in range(steps):
            after = self._next(P)
            sigma = np.sqrt(after.diagonal())
            sigma[sigma == 0.0] = 1.0
            change = float(np.max(np.abs(after - P) / np.outer(sigma, sigma)))
            P = after
            if change <= 4.0 * len(P) * EPS or not math.isfinite(change):
                break
        if not change <= _AT_REST:
            raise self._refusal("the covariance does not come to rest")
        return P

    def _error_transition(self, P: Matrix) -> Matrix:
        """What a cycle makes of the error of x (n, n): F, then I - K H of every sensor."""
        product = self._transition.F
        for turn in self._cycle(P)[0]:
            unit = np.eye(len(turn.R))
            K = np.column_stack([self._updated(turn, unit[k]).dx for k in range(len(unit))])
            product = (np.eye(self.model.n) - K @ turn.H) @ product
        return product

    def _refusal(self, why: str) -> SpecError:
        options = self.model.spec.filter
        return SpecError.at(
            options.places.get("gain", options.place),
            f"no steady state: {why}",
            "a state that does not decay needs process noise and a sensor that sees it; or remove `gain`",
        )
