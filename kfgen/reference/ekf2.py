"""The second-order extended Kalman filter.

Athans, Wishner & Bertolini 1968; Bar-Shalom, Li & Kirubarajan 2001, section 10.3.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from kfgen.reference.algorithm import Estimate
from kfgen.reference.dual import Matrix, Number, Vector, hessian
from kfgen.reference.ekf import Ekf
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Context
from kfgen.reference.process import Transition
from kfgen.reference.sensor import Linearisation, Reading
from kfgen.reference.status import Status, StepError


class Ekf2(Ekf):
    """Adds to the ekf what the second derivatives make of Gaussian states and noise inputs.

    Noises given by a density count in first order, as they do in the ekf.
    """

    def transition(self, estimate: Estimate, context: Context) -> Transition:
        """The ekf's step with f + 1/2 tr(f'' B) and Q + 1/2 tr(f_i'' B f_j'' B), B = diag(P, Qw)."""
        first = super().transition(estimate, context)
        B = block_diag(estimate.P, self.process.held_covariance(estimate.x, context))
        shift, spread = curvature(self.process.expand(estimate.x, context), B)
        return Transition(first.x + shift, first.F, symmetric(first.Q + spread))

    def linearise(self, estimate: Estimate, reading: Reading) -> Linearisation:
        """The ekf's prediction with h + 1/2 tr(h'' B) and R + 1/2 tr(h_i'' B h_j'' B), B = diag(P, Re)."""
        first = super().linearise(estimate, reading)
        B = block_diag(estimate.P, reading.sensor.input_covariance(estimate.x, reading.context))
        shift, spread = curvature(reading.sensor.expand(estimate.x, reading), B)
        return replace(first, h=first.h + shift, R=first.R + spread, inputs=first.inputs + spread)


def curvature(numbers: Sequence[Number], B: Matrix) -> tuple[Vector, Matrix]:
    """What second derivatives add to the mean (m) and covariance (m, m) of m functions of Gaussian variables
    with covariance B (k, k). Raises StepError NOT_FINITE."""
    bent = [hessian(number, len(B)) @ B for number in numbers]
    shift = np.array([0.5 * np.trace(bend) for bend in bent])
    spread = np.array([[0.5 * np.trace(a @ b) for b in bent] for a in bent])
    if not (np.isfinite(shift).all() and np.isfinite(spread).all()):
        raise StepError(Status.NOT_FINITE)
    return shift, symmetric(spread)
