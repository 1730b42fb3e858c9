"""The iterated extended Kalman filter: Gauss-Newton on the posterior density (Bell & Cathey 1993).

On rotations as He, Xu & Zhang 2021 have it: the prior is moved to the tangent space at every iterate.
"""

from __future__ import annotations

import numpy as np

from kfgen.reference.algorithm import Correction, Estimate, Innovation
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.ekf import Ekf, Measured
from kfgen.reference.joseph import update
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Model, wrap
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
        """x_{i+1} = x_i [+] (K_i (z - h(x_i) + H_i J_i^-1 e_i) - J_i^-1 e_i) from x_0, the prior; P from the last one.

        e_i = x_i [-] x_0, J_i = d((x_i [+] d) [-] x_0)/dd, P_i = J_i^-1 P J_i^-T. H_i, R_i and the noise inputs' M_i
        are those at x_i. Differences of periodic states are wrapped, and so are the iterates; bounds apply to the
        result only. P is that seen from x_N-1, where the last step begins.
        """
        measured = innovation.detail
        assert isinstance(measured, Measured)
        x, sensor, model = estimate.x, reading.sensor, self.model
        back = np.zeros(model.n)  # J^-1 e
        rules = self.treatment.rules(reading.context)
        result = update(estimate.P, measured.H, measured.R, measured.y, rules)
        flags = result.flags
        for _ in range(self._iterations - 1):
            x = model.wrap(model.space.moved(x, result.dx - back))
            if not np.isfinite(x).all():
                raise StepError(Status.NOT_FINITE)
            back, P = self._prior(estimate, x)
            linear = sensor.linearise(x, reading)
            y = sensor.innovation(linear.h, x, reading) + linear.H @ back
            result = update(P, linear.H, linear.R, y, rules)
            flags |= result.flags
        x, P, limited = self.limits.finish(model.space.moved(x, result.dx - back), result.P, reading.context)
        return Correction(Estimate(x, P, adapted=estimate.adapted), result.log_likelihood, flags | limited)

    def _prior(self, estimate: Estimate, x: Vector) -> tuple[Vector, Matrix]:
        """The prior in the tangent space at an iterate x (nx): J^-1 e (n) and J^-1 P J^-T (n, n)."""
        space = self.model.space
        e = space.difference(x, estimate.x)
        for i, period in self.model.turns.items():
            e[i] = wrap(float(e[i]), period)
        if not space.rotations:
            return e, estimate.P
        inverse = np.linalg.inv(space.transport(x, estimate.x))
        return inverse @ e, symmetric(inverse @ estimate.P @ inverse.T)
