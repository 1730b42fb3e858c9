"""The Kalman filter and the extended Kalman filter, dense.

Kalman 1960; Bar-Shalom, Li & Kirubarajan 2001, sections 5.2 and 10.3. One filter serves `kf` and `ekf` and
all forms of the covariance: they differ in how they compute, not in what.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from kfgen.reference.adapt import Adapted
from kfgen.reference.algorithm import Algorithm, Correction, Estimate, Innovation, Passage
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.joseph import Update, update
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process, Transition
from kfgen.reference.rules import Treatment
from kfgen.reference.sensor import Linearisation, Reading
from kfgen.reference.status import Status, StepError


@dataclass(frozen=True)
class Measured:
    """An innovation y (k) with H (k, n) and R (k, k), all of the components in use; noise: the adapted R
    (m, m) of the whole sensor that went into it, or None; plain: the update by which nis was judged."""

    y: Vector
    H: Matrix
    R: Matrix
    noise: Matrix | None
    plain: Update


class Ekf(Algorithm):
    """First order: every Jacobian at the state before the step."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.process = Process(model)
        self.treatment = Treatment(model)

    def transition(self, estimate: Estimate, context: Context) -> Transition:
        """The step of the state, its Jacobian, and what it adds to the covariance."""
        return self.process.linearise(estimate.x, context, self.adaptation.additive(estimate.adapted, context))

    def linearise(self, estimate: Estimate, reading: Reading) -> Linearisation:
        """The prediction of the reading, its Jacobian, and the covariance of its noise."""
        return reading.sensor.linearise(estimate.x, reading, learnt=self.adaptation.R)

    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T, with F, G and Q at the prior x."""
        transition = self.transition(estimate, context)
        F = transition.F
        P = symmetric(F @ estimate.P @ F.T + transition.Q)
        x, P, flags = self.limits.finish(transition.x, P, context)
        adapted = self.adaptation.after_step(estimate.adapted, context)
        passage = Passage(x, P, estimate.P @ F.T)
        return replace(estimate, x=x, P=P, memory=None, adapted=adapted, passage=passage), flags

    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """y = z - h(x), S = H P H^T + R + M Re M^T; nis = y^T S^-1 y."""
        linear = self.linearise(estimate, reading)
        H, R, noise = linear.H, linear.R, None
        if self.adaptation.R:
            noise = self.adaptation.noise(estimate.adapted, reading, H @ estimate.P @ H.T)
            R = symmetric(noise[np.ix_(reading.rows, reading.rows)] + linear.inputs)
        y = reading.sensor.innovation(linear.h, estimate.x, reading)
        plain = update(estimate.P, H, R, y, self.treatment.plain)
        if not math.isfinite(plain.nis):
            raise StepError(Status.NOT_FINITE)
        return Innovation(plain.nis, Measured(y, H, R, noise, plain))

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """x <- x [+] K y, P in Joseph's form, as seen from there; then R and Q where they adapt."""
        measured = innovation.detail
        assert isinstance(measured, Measured)
        result = measured.plain
        if not self.treatment.trivial:
            rules = self.treatment.rules(reading.context)
            result = update(estimate.P, measured.H, measured.R, measured.y, rules)
        x, P, flags = self.limits.corrected(estimate.x, result.P, result.dx, reading.context)
        adapted = self._adapted(estimate.adapted, reading, measured.noise, x, result)
        return Correction(Estimate(x, P, adapted=adapted), result.log_likelihood, flags | result.flags)

    def _adapted(self, adapted: Adapted, reading: Reading, noise: Matrix | None, x: Vector, result: Update) -> Adapted:
        """What an update that stores x (nx) leaves of the adapted covariances."""
        if noise is not None:
            adapted = self.adaptation.with_noise(adapted, reading, noise, reading.sensor.residual(x, reading))
        if self.adaptation.Q:
            assert result.steps is not None
            adapted = self.adaptation.with_steps(adapted, result.steps)
        return adapted
