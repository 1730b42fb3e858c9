"""Noise covariances that follow the innovations (adapt_R, adapt_Q): exponential forgetting.

Mehra 1972; Akhlaghi, Zhou & Huang 2017.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Context, Model
from kfgen.reference.reading import adapted_names
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.spec.sensors import filter_of


@dataclass(frozen=True)
class Adapted:
    """R: sensor -> (m, m), e: sensor -> (m) the residual after its last update; Q (n, n), per second where dt is given
    at run time and the spec's Q is a constant times dt. Empty or None where the spec does not adapt them. Without the
    covariances of noise inputs. dt: the last step's, at first the spec's."""

    R: Mapping[str, Matrix] = field(default_factory=dict)
    e: Mapping[str, Vector] = field(default_factory=dict)
    Q: Matrix | None = None
    dt: float = 1.0


NOTHING = Adapted()


class Adaptation:
    """The adaptation of a spec's R and Q. Attributes: R, Q: whether it adapts them."""

    def __init__(self, model: Model) -> None:
        options = model.spec.filter
        self.model = model
        self._a = 0.0 if options.adapt_R is None else model.number(options.adapt_R)
        self._b = 0.0 if options.adapt_Q is None else model.number(options.adapt_Q)
        self.R, self.Q = options.adapt_R is not None, options.adapt_Q is not None
        dt = model.spec.dt
        self._rate = dt is not None and dt.run_time and "dt" in adapted_names(model.spec)
        self._dt = model.number(dt.nominal) if dt is not None and self._rate else 1.0

    def initial(self) -> Adapted:
        """The spec's R and Q, which are constant, and no residuals."""
        model, adapted = self.model, NOTHING
        context = Context(model.values, np.zeros(len(model.inputs)), 0.0, 1.0)
        learnt = [s for s in model.spec.measurements if filter_of(model.spec.filter, s).adapt_R is not None]
        if learnt:
            sensors = [SensorModel(model, sensor) for sensor in learnt]
            R = {sensor.name: sensor.noise(model.x0, context) for sensor in sensors}
            adapted = replace(adapted, R=R, e={sensor.name: np.zeros(sensor.space.k) for sensor in sensors})
        if self.Q:
            Q = model.covariance(model.spec.dynamics.Q, model.errors)
            adapted = replace(adapted, Q=symmetric(Q(model.environment(context, model.x0))), dt=self._dt)
        return adapted

    def additive(self, adapted: Adapted, context: Context) -> Matrix | None:
        """The Q (n, n) of a step; None where it is the spec's."""
        return adapted.Q * context.dt if adapted.Q is not None and self._rate else adapted.Q

    def after_step(self, adapted: Adapted, context: Context) -> Adapted:
        return replace(adapted, dt=context.dt) if self._rate else adapted

    def noise(self, adapted: Adapted, reading: Reading, spread: Matrix) -> Matrix:
        """R (m, m) for an update: (1 - a) R + a (spread + e e^T), spread (k, k) = H P H^T of the components
        in use, e the residual after the sensor's last update.

        Of what is not in use nothing is learnt; its correlations with the others are forgotten.
        """
        name, used = reading.sensor.name, list(reading.rows)
        R, e = adapted.R[name].copy(), adapted.e[name][used]
        others = [i for i in range(len(R)) if i not in used]
        R[np.ix_(used, used)] = (1.0 - self._a) * R[np.ix_(used, used)] + self._a * (spread + np.outer(e, e))
        R[np.ix_(used, others)] *= 1.0 - self._a
        R[np.ix_(others, used)] *= 1.0 - self._a
        return symmetric(R)

    def with_noise(self, adapted: Adapted, reading: Reading, R: Matrix, residual: Vector) -> Adapted:
        """Keeps the R (m, m) of an update that was made, and its residual (k), z - h(x) at the x it stored."""
        name = reading.sensor.name
        e = adapted.e[name].copy()
        e[list(reading.rows)] = residual
        return replace(adapted, R={**adapted.R, name: R}, e={**adapted.e, name: e})

    def with_steps(self, adapted: Adapted, steps: Matrix) -> Adapted:
        """Q <- (1 - b) Q + b sum of dx dx^T over the corrections (k, n) of an update's scalars; of a Q per second
        divided by the last step."""
        assert adapted.Q is not None
        learnt = steps.T @ steps / adapted.dt if self._rate else steps.T @ steps
        return replace(adapted, Q=symmetric((1.0 - self._b) * adapted.Q + self._b * learnt))
