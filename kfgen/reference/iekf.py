"""The iterated extended Kalman filter: Gauss-Newton on the posterior density (Bell & Cathey 1993)."""

from __future__ import annotations

import numpy as np

from kfgen.reference.algorithm import Correction, Estimate, Innovation
from kfgen.reference.ekf import Ekf, Measured
from kfgen.reference.joseph import update
from kfgen.reference.model import Model
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError


class Iekf(Ekf):
    """Predicts, and is judged by nis and the gate, like the ekf; the update linearises h again and again."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        iterations = model.spec.filter.iterations
        assert iterations is not None
        self._iterations = iterations

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """x_{i+1} = x + K_i (z - h(x_i) - H_i (x - x_i)) from x_0 = x, the prior; P from the last K_i, H_i.

        H_i, R_i and the noise inputs' M_i are those at x_i. Differences of periodic states are wrapped, and so
        are the iterates; bounds apply to the result only.
        """
        measured = innovation.detail
        assert isinstance(measured, Measured)
        prior, sensor, model = estimate.x, reading.sensor, self.model
        rules = self.treatment.rules(reading.context)
        result = update(estimate.P, measured.H, measured.R, measured.y, rules)
        flags = result.flags
        for _ in range(self._iterations - 1):
            x = model.wrap(prior + result.dx)
            if not np.isfinite(x).all():
                raise StepError(Status.NOT_FINITE)
            linear = sensor.linearise(x, reading)
            y = sensor.innovation(linear.h, x, reading) - linear.H @ model.wrap(prior - x)
            result = update(estimate.P, linear.H, linear.R, y, rules)
            flags |= result.flags
        x, P, limited = self.limits.finish(prior + result.dx, result.P, reading.context)
        return Correction(Estimate(x, P, adapted=estimate.adapted), result.log_likelihood, flags | limited)
