"""A reading against what a cloud of sigma points predicts of it: its innovation and all an update needs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kfgen.reference.adapt import Adaptation
from kfgen.reference.algorithm import Estimate
from kfgen.reference.carried import carried_by_sensor, wrapped_by_sensor
from kfgen.reference.cloud import Cloud, Drawing
from kfgen.reference.dual import Matrix, Vector, values
from kfgen.reference.joseph import PLAIN, Rules, Update, update
from kfgen.reference.linalg import EPS, check_covariance, symmetric, udu
from kfgen.reference.model import Model
from kfgen.reference.pivots import Pivots, judge, pivots
from kfgen.reference.sensor import Reading
from kfgen.reference.sigma_points import Images, upper_root
from kfgen.reference.status import Status, StepError


@dataclass(frozen=True)
class Predicted:
    """A reading as a cloud predicts it: its mean; images of the points (N, k) as seen from there, their covariances
    with each other, spread (k, k), with the state, cross (n, k), and with the carried noises, noise (q, k)."""

    mean: Vector
    images: Images
    spread: Matrix
    cross: Matrix
    noise: Matrix


@dataclass(frozen=True)
class Measured:
    """A reading against its prediction.

    y (k): the innovation. exact: whether some direction of it has no noise. noise: the adapted R (m, m) of the whole
    sensor that went into it, or None. S: the factors of the innovation covariance. nis: y^T S^-1 y.
    """

    cloud: Cloud
    predicted: Predicted
    y: Vector
    exact: bool
    noise: Matrix | None
    S: Pivots
    nis: float
    flags: Status


@dataclass(frozen=True)
class Scalars:
    """A reading whose components are processed one by one: y (k), H (k, n), R (k, k); noise: as in Measured;
    plain: the update by which nis was judged."""

    y: Vector
    H: Matrix
    R: Matrix
    noise: Matrix | None
    plain: Update


class Measuring:
    """The measurement side of a spec's sigma-point filter. plain: the rules by which nis is judged."""

    def __init__(self, model: Model, drawing: Drawing, adaptation: Adaptation, plain: Rules = PLAIN) -> None:
        self.drawing, self.adaptation, self.plain = drawing, adaptation, plain
        self._carried: dict[str, tuple[int, ...]] = {}
        self._wrapped = {sensor.name: wrapped_by_sensor(model, sensor) for sensor in model.spec.measurements}
        for sensor in model.spec.measurements:
            names = [noise.name for noise in sensor.noise]
            # custom points have columns for the states only: all noise inputs stay M Re M^T
            carried = () if drawing.rule.own else carried_by_sensor(model, sensor)
            self._carried[sensor.name] = tuple(names.index(name) for name in carried)

    def draw(self, x: Vector, P: Matrix, reading: Reading) -> Cloud:
        """Points of x (nx), P (n, n) and of the sensor's carried noises. Raises StepError NOT_FINITE."""
        C = self._input_covariance(x, reading, self._carried[reading.sensor.name])
        return self.drawing.draw(x, P, C)

    def residual(self, x: Vector, P: Matrix, reading: Reading) -> Vector:
        """The residual (k) of the reading against points drawn from x (nx) and P (n, n). Raises NOT_FINITE."""
        seen = self._predicted(x, reading, self.draw(x, P, reading))
        return reading.sensor.innovation(seen.mean, x, reading)

    def whole(self, estimate: Estimate, reading: Reading, cloud: Cloud, noise: Matrix | None = None) -> Measured:
        """The innovation and its covariance S = R + spread of the predicted readings.

        noise (m, m): the adapted R, if it is known already. Raises StepError NOT_FINITE, NOT_POSITIVE.
        """
        seen = self._predicted(estimate.x, reading, cloud)
        R, noise = self._noise(estimate, reading, cloud, seen, noise)
        y = reading.sensor.innovation(seen.mean, estimate.x, reading)
        S = symmetric(seen.spread + R)
        if not np.isfinite(S).all():
            raise StepError(Status.NOT_FINITE)
        check_covariance(self._input_covariance(estimate.x, reading, self._within(cloud, reading)))
        exact = bool(np.any(udu(R)[1] == 0.0))
        if cloud.weights.negative:
            judge(S, seen.images.size + R.diagonal())
        smallest = 8.0 * len(S) * EPS * S.diagonal()
        lack = np.maximum(self.plain.floor - S.diagonal(), 0.0) if self.plain.floor > 0.0 else np.zeros(len(S))
        flags = Status.REGULARIZED if np.any(lack) else Status.OK
        factors = pivots(S + np.diag(lack), smallest)
        nis = float(np.sum(factors.squares(y)))
        if not math.isfinite(nis):
            raise StepError(Status.NOT_FINITE)
        return Measured(cloud, seen, y, exact, noise, factors, nis, flags)

    def scalars(self, estimate: Estimate, reading: Reading, cloud: Cloud) -> Scalars:
        """The measurement matrix that regression on the points gives: H = Pxz^T P^-1; carried noises likewise.

        It leaves out the covariance of the linearisation error (an approximation, and cheap).
        Raises StepError NOT_FINITE, NOT_POSITIVE.
        """
        seen = self._predicted(estimate.x, reading, cloud)
        R, noise = self._noise(estimate, reading, cloud, seen, None)
        C = self._input_covariance(estimate.x, reading, self._within(cloud, reading))
        H, M = regression(estimate.P, seen.cross), regression(C, seen.noise)
        R = symmetric(R + M @ C @ M.T)
        y = reading.sensor.innovation(seen.mean, estimate.x, reading)
        if not (np.isfinite(H).all() and np.isfinite(R).all()):
            raise StepError(Status.NOT_FINITE)
        check_covariance(C)
        plain = update(estimate.P, H, R, y, self.plain)
        if not math.isfinite(plain.nis):
            raise StepError(Status.NOT_FINITE)
        return Scalars(y, H, R, noise, plain)

    def _within(self, cloud: Cloud, reading: Reading) -> tuple[int, ...]:
        """The noise inputs of the sensor of which a cloud holds values: kept points have none."""
        return self._carried[reading.sensor.name] if cloud.noise.shape[1] else ()

    def _input_covariance(self, x: Vector, reading: Reading, inputs: tuple[int, ...]) -> Matrix:
        if not inputs:
            return np.zeros((0, 0))
        C = reading.sensor.input_covariance(x, reading.context)[np.ix_(inputs, inputs)]
        if not np.isfinite(C).all():
            raise StepError(Status.NOT_FINITE)
        return symmetric(C)

    def _noise(
        self, estimate: Estimate, reading: Reading, cloud: Cloud, seen: Predicted, noise: Matrix | None
    ) -> tuple[Matrix, Matrix | None]:
        """R (k, k) with M Re M^T of the noises that are not carried, and the adapted R (m, m) in it, if any."""
        sensor, x, used = reading.sensor, estimate.x, reading.used
        if self.adaptation.R and noise is None:
            noise = self.adaptation.noise(estimate.adapted, reading, seen.spread)
        R = sensor.noise(x, reading.context, used) if noise is None else noise[np.ix_(reading.rows, reading.rows)]
        carried = self._within(cloud, reading)
        rest = [i for i in range(len(sensor.spec.noise)) if i not in carried]
        if rest:
            R = R + sensor.input_share(x, reading, rest)
        return symmetric(R), noise

    def _predicted(self, x: Vector, reading: Reading, cloud: Cloud) -> Predicted:
        """The reading that a cloud around x (nx) predicts.

        Differences are those from the image of the point at the mean; a set without one has it evaluated beside, if
        a component is periodic or has its own residual. Linear ones are not wrapped; images that are the same but for
        rounding have no spread. Raises StepError NOT_FINITE.
        """
        sensor, carried = reading.sensor, self._within(cloud, reading)
        wrapped = self._wrapped[sensor.name]

        def image(point: Vector, e: Vector) -> Vector:
            noise = np.zeros(len(sensor.spec.noise))
            noise[list(carried)] = e
            at = [float(v) for v in point]
            return values(sensor.predict(at, [float(v) for v in noise], reading.context, reading.used))

        raw = np.array([image(point, e) for point, e in zip(cloud.points, cloud.noise, strict=True)])
        middle = cloud.weights.centre
        beside = middle is None and any(sensor.turns[i] for i in reading.used)
        base = image(x, np.zeros(len(carried))) if beside else raw[middle or 0]
        if not (np.isfinite(raw).all() and np.isfinite(base).all()):
            raise StepError(Status.NOT_FINITE)
        e = np.array([sensor.difference(z, base, x, reading, wrapped) for z in raw])
        e = np.where(np.max(np.abs(e), axis=0) <= self._rounding(reading, cloud, raw), 0.0, e)
        images = Images(cloud.weights, base, e, cloud.weights.wm @ e)
        mean = reading.space.moved(base, images.d)
        images = images.moved(reading.space.turned(images.d))
        spread = symmetric(images.covariance(images))
        return Predicted(mean, images, spread, cloud.states.covariance(images), cloud.noises.covariance(images))

    def _rounding(self, reading: Reading, cloud: Cloud, raw: Matrix) -> Vector:
        """By how much images (k) may differ by the rounding of what h adds up in them: |h| + |H| |x|.

        H is the smaller one of two points: a pole near one of them says nothing.
        """
        space = reading.sensor.model.space
        H = np.fmin.reduce([np.abs(reading.sensor.jacobian(cloud.points[i], reading)) for i in (0, -1)])
        terms: Vector = np.where(np.isfinite(H), H, 0.0) @ np.max([space.size(point) for point in cloud.points], axis=0)
        images = np.max([reading.space.size(image) for image in raw], axis=0)
        size: Vector = 16.0 * EPS * (images + terms)
        return size


def regression(P: Matrix, cross: Matrix) -> Matrix:
    """H (k, n) with H P = cross^T, cross (n, k): cross^T P^-1, with zero columns where P = U D U^T has zero pivots."""
    root = upper_root(P)
    D = root.diagonal() ** 2
    U = np.eye(len(P))
    U[:, D > 0.0] = root[:, D > 0.0] / np.sqrt(D[D > 0.0])
    inverse = np.array([1.0 / d if d > 0.0 else 0.0 for d in D])
    H: Matrix = np.linalg.solve(U.T, inverse[:, None] * np.linalg.solve(U, cross)).T
    return H
