"""The Kalman filter and the extended Kalman filter, dense.

Kalman 1960; Bar-Shalom, Li & Kirubarajan 2001, sections 5.2 and 10.3. One filter serves `kf` and `ekf` and
all forms of the covariance: they differ in how they compute, not in what.
"""

from __future__ import annotations

import math

from kfgen.reference.algorithm import Algorithm, Correction, Estimate, Innovation
from kfgen.reference.joseph import Update, update
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError


class Ekf(Algorithm):
    """First order: every Jacobian at the state before the step."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.process = Process(model)

    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T, with F, G and Q at the prior x."""
        transition = self.process.linearise(estimate.x, context)
        F = transition.F
        P = symmetric(F @ estimate.P @ F.T + transition.Q)
        x, P, flags = self.limits.finish(transition.x, P, context)
        return Estimate(x, P), flags

    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """y = z - h(x), S = H P H^T + R + M Re M^T; nis = y^T S^-1 y."""
        sensor = reading.sensor
        linear = sensor.linearise(estimate.x, reading)
        y = sensor.innovation(linear.h, estimate.x, reading)
        result = update(estimate.P, linear.H, linear.R, y)
        if not math.isfinite(result.nis):
            raise StepError(Status.NOT_FINITE)
        return Innovation(result.nis, result)

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """x <- x + K y, P in Joseph's form."""
        result = innovation.detail
        assert isinstance(result, Update)
        x, P, flags = self.limits.finish(estimate.x + result.dx, result.P, reading.context)
        return Correction(Estimate(x, P), result.log_likelihood, flags)
