"""The unscented Kalman filter, dense: every form of the covariance, the whole vector at once or sequentially.

Julier & Uhlmann 2004; van der Merwe 2004, algorithms 2.1 and 3.1; Sarkka & Svensson 2023, algorithm 8.17. The
forms of the covariance differ in the root that spreads the points (and so in the result, for what is not
linear), and in the square root's flag where a downdate meets zero.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kfgen.reference.algorithm import Algorithm, Correction, Estimate, Innovation, Passage
from kfgen.reference.carried import carried_by_process, wrapped_by_process
from kfgen.reference.chi2 import chi2_quantile
from kfgen.reference.cloud import Cloud, Drawing
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.joseph import update
from kfgen.reference.linalg import EPS, symmetric
from kfgen.reference.measuring import Measured, Measuring, Scalars
from kfgen.reference.model import Context, Model, wrap
from kfgen.reference.pivots import bounded, downdated, judge, pivots
from kfgen.reference.process import Process
from kfgen.reference.rules import Treatment
from kfgen.reference.sensor import Reading
from kfgen.reference.sigma_points import Images, lower_root
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
        self._wrapped = wrapped_by_process(model)
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
        images, flags = self._images(cloud, context)
        space = self.model.space
        mean = space.moved(images.base, images.d)
        images = images.moved(space.turned(images.d))
        P = symmetric(images.covariance(images)) + noise.added
        if not (np.isfinite(mean).all() and np.isfinite(P).all()):
            raise StepError(Status.NOT_FINITE)
        noise.judge()
        if cloud.weights.negative:
            judge(P, images.size + noise.added.diagonal())
            P = bounded(P, np.zeros(self.model.n))
        P, gone = self._as_root(P, images, noise.added)
        stored, P, more = self.limits.finish(mean, P, context)
        kept = None
        if self.keeps and not more:  # points that a floor or ceiling contradicts are none of this estimate
            # what is kept are deviations, as seen from the mean: numbers lie where f left them, rotations where these
            # lead from the mean; angles near the mean that is stored, which was wrapped
            turn = np.array([stored[i] - mean[i] if i in self.model.periods else 0.0 for i in range(len(mean))])
            points = np.array([space.moved(mean, deviation) for deviation in images.deviations])
            kept = Cloud(points + turn, np.zeros((len(images.e), 0)), images)
        passage = Passage(stored, P, cloud.states.covariance(images))
        return replace(estimate, x=stored, P=P, memory=kept, passage=passage), flags | gone | more

    def _images(self, cloud: Cloud, context: Context) -> tuple[Images, Status]:
        """f at the points, within the bounds; those that are rejected replaced by f at the centre.

        A set without a point at the mean has f evaluated there beside, if something turns. Raises NOT_FINITE.
        """
        raw, model = [], self.model
        for point, values in zip(cloud.points, cloud.noise, strict=True):
            w = np.zeros(self._held)
            w[self._places] = values
            raw.append(self.process.advance(point, w, context))
        flags, middle = Status.OK, cloud.weights.centre
        base = raw[middle or 0]
        if middle is None and (self._wrapped or model.space.rotations):
            base = self.process.advance(model.clip(cloud.states.base), np.zeros(self._held), context)
        if self._rejects:
            for i, image in enumerate(raw):
                if i != middle and self._rejected(image, context):
                    raw[i], flags = base, Status.POINT_REJECTED
        if not (np.isfinite(raw).all() and np.isfinite(base).all()):
            raise StepError(Status.NOT_FINITE)
        base = model.clip(base)
        e = np.array([model.space.difference(model.clip(image), base) for image in raw])
        for i in self._wrapped:
            e[:, i] = [wrap(float(difference), model.turns[i]) for difference in e[:, i]]
        return Images(cloud.weights, base, e, cloud.weights.wm @ e), flags

    def _rejected(self, image: Vector, context: Context) -> bool:
        """Whether the spec rejects the image (nx) of a point, as f left it; t is that of the step's start."""
        if not np.isfinite(image).all():
            return True
        return self._reject is not None and bool(self._reject(self.model.environment(context, image)))

    def _as_root(self, P: Matrix, images: Images, added: Matrix) -> tuple[Matrix, Status]:
        """P (n, n) of a prediction as the square-root form has it (van der Merwe & Wan 2001, equations 20, 21):
        the root of what has positive weights, then a downdate for each term with a negative one."""
        weights = images.weights
        if self.model.spec.filter.covariance != "sqrt" or not weights.negative:
            return P, Status.OK
        if weights.shift is not None:
            terms = math.sqrt(-weights.shift) * images.d[None, :]
        else:
            terms = np.sqrt(np.maximum(-weights.wc, 0.0))[:, None] * images.deviations
        S, gone = lower_root(symmetric(P + terms.T @ terms)), False
        for term in terms:
            S, zero = downdated(S, term, _rounding(P))
            gone = gone or zero
        return (S @ S.T, Status.REGULARIZED) if gone else (P, Status.OK)

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
        """x <- x [+] K y, P <- P - K S K^T, as seen from there; then R where it adapts."""
        detail = innovation.detail
        if isinstance(detail, Scalars):
            return self._correct_scalars(estimate, reading, detail)
        assert isinstance(detail, Measured)
        flags, measured = Status.OK, detail
        inflation = self._inflation(measured, len(reading.rows))
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
        known = pivots(measured.predicted.spread, self._known * measured.S.D)
        terms = known.squares(measured.y)[measured.S.D > 0.0]
        return float(np.sum(terms)) * (1.0 / threshold - 1.0 / measured.nis)

    def _correct(self, estimate: Estimate, reading: Reading, measured: Measured, flags: Status) -> Correction:
        """The update with the whole vector: P - K S K^T.

        Without noise in some direction, a variance that an exact measurement leaves is nothing but rounding.
        """
        context, n = reading.context, self.model.n
        K = measured.S.gain(measured.predicted.cross)
        P = symmetric(estimate.P - K @ measured.S.matrix @ K.T)
        if not np.isfinite(P).all():
            raise StepError(Status.NOT_FINITE)
        weights = measured.cloud.weights
        definite = weights.exact and not weights.negative
        if not definite:
            judge(P, 2.0 * estimate.P.diagonal())
        P = bounded(P, (8.0 * n * EPS if measured.exact else 0.0) * estimate.P.diagonal())
        if self.model.spec.filter.covariance == "sqrt":
            S, gone = lower_root(estimate.P), False
            for w in (K @ measured.S.L * np.sqrt(measured.S.D)).T:
                S, zero = downdated(S, w, _rounding(estimate.P), definite)
                gone = gone or zero
            if gone:
                P, flags = S @ S.T, flags | Status.REGULARIZED
        x, P, more = self.limits.corrected(estimate.x, P, K @ measured.y, context)
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
        x, P, flags = self.limits.corrected(estimate.x, result.P, result.dx, reading.context)
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
