"""The unscented Kalman filter, dense: every form of the covariance, the whole vector at once or sequentially.

Julier & Uhlmann 2004; van der Merwe 2004, algorithms 2.1 and 3.1; Sarkka & Svensson 2023, algorithm 8.17. The
forms of the covariance differ in the root that spreads the points (and so in the result, for what is not
linear), in where the floor and ceiling take hold, and in the square root's flag where a downdate meets zero.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kfgen.reference.algorithm import Algorithm, Correction, Estimate, Innovation
from kfgen.reference.carried import carried_by_process
from kfgen.reference.chi2 import chi2_quantile
from kfgen.reference.cloud import Cloud, Drawing, average, centre, magnitude, wrapped
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.joseph import update
from kfgen.reference.linalg import EPS, symmetric
from kfgen.reference.measuring import Measured, Measuring, Scalars
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process
from kfgen.reference.rules import Treatment
from kfgen.reference.sensor import Reading
from kfgen.reference.sigma_points import lower_root
from kfgen.reference.spread import Spread, downdated, pivots, settled, spread
from kfgen.reference.status import Status, StepError
from kfgen.spec import DOUBLE
from kfgen.spec.types import Adaptive


class Ukf(Algorithm):
    """The memory of an estimate is the Cloud that predict keeps for an update (`redraw: false`), or None."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        options = model.spec.filter
        points = options.sigma_points
        assert points is not None
        self.process = Process(model)
        self.treatment = Treatment(model)
        self.drawing = Drawing(model)
        self.keeps = not points.redraw
        self.measuring = Measuring(model, self.drawing, self.adaptation, self.treatment.plain)
        # custom points have columns for the states only: all noise inputs stay G Qw G^T
        self._carried = () if self.drawing.rule.own else carried_by_process(model)
        held = [noise.name for noise in model.spec.noise if not noise.density]
        self._places = [held.index(name) for name in self._carried]
        self._held = len(held)
        reject = options.reject
        self._rejects = reject is not None
        self._reject = None if reject is None or isinstance(reject, str) else model.scope.compile(reject)
        # pivots of the predicted reading's covariance that count for the inflation, relative to those of S
        self._known = 1e-12 if model.spec.scalar == DOUBLE else 1e-6

    # --- predict

    def predict(self, estimate: Estimate, context: Context) -> tuple[Estimate, Status]:
        """Points through f; x <- their mean, P <- their spread + Q + G Qw G^T of the noises they do not carry."""
        x = estimate.x
        noise = self.process.disturbance(x, context, self._carried)
        cloud = self.drawing.draw(x, estimate.P, noise.carried)
        weights = cloud.weights
        raw, flags = self._images(cloud, context)
        images = np.array([self.model.clip(image) for image in raw])
        bent = [i in self.model.periods for i in range(self.model.n)]

        def beside() -> Vector:
            point = self.model.clip(x)
            return self.model.clip(self.process.advance(point, np.zeros(self._held), context))

        base = centre(images, weights, bent, beside)
        terms = magnitude(lambda point: self.process.jacobian(point, context), cloud.points)
        mean, around = average(images, base, wrapped(images - base, self.model), weights, terms)
        P = around.covariance + noise.added
        if not (np.isfinite(mean).all() and np.isfinite(P).all()):
            raise StepError(Status.NOT_FINITE)
        noise.judge()
        P, gone = self._spread_as_root(P, around, weights.wc, noise.added)
        x, P, more = self._finish(mean, P, around.rounding, context)
        kept = None
        if self.keeps and not more:  # points that a floor or ceiling contradicts are none of this estimate
            # angles of points near the mean that is stored, which was wrapped
            turns = np.where(bent, self.model.wrap(mean) - mean, 0.0)
            near = np.where(bent, mean + around.deviations + turns, images)
            none, rest = np.zeros((len(near), 0)), P - around.covariance
            kept = Cloud(weights, near, none, around.deviations, around.errors, around.drift, rest)
        return replace(estimate, x=x, P=P, memory=kept), flags | gone | more

    def _images(self, cloud: Cloud, context: Context) -> tuple[Matrix, Status]:
        """f at the points (N, n); those that are rejected replaced by f at the centre. Raises NOT_FINITE."""
        images = []
        for point, values in zip(cloud.points, cloud.noise, strict=True):
            w = np.zeros(self._held)
            w[self._places] = values
            images.append(self.process.advance(point, w, context))
        flags, middle = Status.OK, cloud.weights.centre
        if self._rejects and middle is not None:
            for i, image in enumerate(images):
                if i != middle and self._rejected(image, context):
                    images[i], flags = images[middle], Status.POINT_REJECTED
        if not np.isfinite(images).all():
            raise StepError(Status.NOT_FINITE)
        return np.array(images), flags

    def _rejected(self, image: Vector, context: Context) -> bool:
        """Whether the spec rejects the image (n) of a point, as f left it; t is that of the step's start."""
        if not np.isfinite(image).all():
            return True
        return self._reject is not None and bool(self._reject(self.model.environment(context, image)))

    def _spread_as_root(self, P: Matrix, around: Spread, wc: Vector, added: Matrix) -> tuple[Matrix, Status]:
        """P (n, n) of a prediction as the square-root form has it (van der Merwe & Wan 2001, equations 20, 21):
        the root of what has positive weights, then a downdate for each point with a negative one."""
        if self.model.spec.filter.covariance != "sqrt" or np.all(wc >= 0.0):
            return P, Status.OK
        plus, minus, D = wc > 0.0, wc < 0.0, around.deviations
        S, gone = lower_root(symmetric((wc[plus, None] * D[plus]).T @ D[plus] + added)), False
        for weight, deviation in zip(np.sqrt(-wc[minus]), D[minus], strict=True):
            S, zero = downdated(S, weight * deviation, weight * (around.errors + around.drift) + _rounding(P))
            gone = gone or zero
        return (S @ S.T, Status.REGULARIZED) if gone else (P, Status.OK)

    def _finish(self, x: Vector, P: Matrix, rounding: Matrix, context: Context) -> tuple[Vector, Matrix, Status]:
        """What a step stores; P (n, n) is indefinite only by `rounding` (n, n), else NOT_POSITIVE is raised.

        Factored forms must be definite to be factored; a full P is judged as its floor leaves it.
        """
        if not (np.isfinite(x).all() and np.isfinite(P).all()):
            raise StepError(Status.NOT_FINITE)
        full = self.model.spec.filter.covariance == "full"
        x, P, flags = self.limits.finish(x, P if full else settled(P, rounding), context)
        P = settled(P, rounding) if full else P
        if not np.isfinite(P).all():
            raise StepError(Status.NOT_FINITE)
        return x, P, flags

    # --- update

    def innovate(self, estimate: Estimate, reading: Reading) -> Innovation:
        """The reading against the one that the kept points, or points drawn anew, predict."""
        cloud = estimate.memory
        if not isinstance(cloud, Cloud):
            cloud = self.measuring.draw(estimate.x, estimate.P, reading)
        if self.model.spec.filter.sequential:
            scalars = self.measuring.scalars(estimate, reading, cloud)
            return Innovation(scalars.plain.nis, scalars)
        measured = self.measuring.whole(estimate, reading, cloud)
        return Innovation(measured.nis, measured)

    def correct(self, estimate: Estimate, reading: Reading, innovation: Innovation) -> Correction:
        """x <- x + K y, P <- P - K S K^T; then R where it adapts."""
        detail = innovation.detail
        if isinstance(detail, Scalars):
            return self._correct_scalars(estimate, reading, detail)
        assert isinstance(detail, Measured)
        flags, measured = Status.OK, detail
        inflation = self._inflation(measured, len(reading.used))
        if inflation > 0.0:
            estimate = replace(estimate, P=(1.0 + inflation) * estimate.P, memory=None)
            cloud = self.measuring.draw(estimate.x, estimate.P, reading)
            measured = self.measuring.whole(estimate, reading, cloud, measured.noise)
            flags = Status.ANOMALY
        return self._correct(estimate, reading, measured, flags | measured.flags)

    def _inflation(self, measured: Measured, used: int) -> float:
        """The a by which P is to grow, to (1 + a) P: that of the innovation's chi-square test, 0 if it passes."""
        adaptive = self.model.spec.filter.adaptive
        if adaptive is None:
            return 0.0
        threshold = _threshold(self.model, adaptive, used)
        if measured.nis <= threshold:
            return 0.0
        known = pivots(measured.predicted.spread.covariance, self._known * measured.S.D)
        terms = known.squares(measured.y)[measured.S.D > 0.0]
        return float(np.sum(terms)) * (1.0 / threshold - 1.0 / measured.nis)

    def _correct(self, estimate: Estimate, reading: Reading, measured: Measured, flags: Status) -> Correction:
        """The update with the whole vector.

        With K = Pxz S^-1, P - K S K^T is the spread of the deviations dX - K dz, + K R K^T, + what P has beside
        the spread of dX: a sum in which rounding cannot make an exact measurement's variance negative.
        """
        cloud, around = measured.cloud, measured.predicted.spread
        K = measured.S.gain(measured.predicted.cross)
        steps = around.deviations @ K.T
        size = np.max(np.abs(cloud.deviations) + np.abs(around.deviations) @ np.abs(K.T), axis=0)
        errors = cloud.errors + np.abs(K) @ around.errors + 8.0 * EPS * size
        drift = cloud.drift + np.abs(K) @ around.drift
        left = spread(cloud.deviations - steps, errors, drift, cloud.weights.wc)
        P = cloud.rest + left.covariance + symmetric(K @ measured.R @ K.T)
        if self.model.spec.filter.covariance == "sqrt":
            S, gone = lower_root(estimate.P), False
            for w in (K @ measured.S.root).T:
                S, zero = downdated(S, w, _rounding(estimate.P))
                gone = gone or zero
            if gone:
                P, flags = S @ S.T, flags | Status.REGULARIZED
        x, P, more = self._finish(estimate.x + K @ measured.y, P, left.rounding, reading.context)
        D = measured.S.D[measured.S.D > 0.0]
        log_det = float(np.sum(np.log(2.0 * math.pi * D)))
        terms = float(np.sum(measured.S.squares(measured.y)))
        stored = self._adapted(replace(estimate, x=x, P=P, memory=None), reading, measured.noise)
        return Correction(stored, -0.5 * (log_det + terms), flags | more)

    def _correct_scalars(self, estimate: Estimate, reading: Reading, scalars: Scalars) -> Correction:
        """The update with the components one by one, each as an ekf has it."""
        result = scalars.plain
        if not self.treatment.trivial:
            rules = self.treatment.rules(reading.context)
            result = update(estimate.P, scalars.H, scalars.R, scalars.y, rules)
        x, P, flags = self.limits.finish(estimate.x + result.dx, result.P, reading.context)
        stored = self._adapted(replace(estimate, x=x, P=P, memory=None), reading, scalars.noise)
        return Correction(stored, result.log_likelihood, flags | result.flags)

    def _adapted(self, stored: Estimate, reading: Reading, noise: Matrix | None) -> Estimate:
        """The estimate an update leaves, with the R (m, m) that went into it and the residual of points drawn
        from it. Raises StepError NOT_FINITE."""
        if noise is None:
            return stored
        residual = self.measuring.residual(stored.x, stored.P, reading)
        return replace(stored, adapted=self.adaptation.with_noise(stored.adapted, reading, noise, residual))


def _rounding(P: Matrix) -> Vector:
    """What is nothing (n) beside the standard deviations of P (n, n)."""
    sigma: Vector = np.sqrt(np.maximum(P.diagonal(), 0.0))
    return 8.0 * len(P) * EPS * sigma


def _threshold(model: Model, adaptive: Adaptive, dimensions: int) -> float:
    """The chi-square quantile for so many components, or the threshold that the spec gives instead."""
    if adaptive.chi2 is not None:
        return model.number(adaptive.chi2)
    probability = 0.999 if adaptive.probability is None else model.number(adaptive.probability)
    return chi2_quantile(probability, dimensions)
