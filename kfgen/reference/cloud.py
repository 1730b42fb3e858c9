"""Sigma points of an estimate, and what becomes of them in a step and in a measurement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import EPS
from kfgen.reference.model import Model, wrap
from kfgen.reference.sigma_points import ROOTS, PointSet, SigmaRule
from kfgen.reference.spread import Spread, spread
from kfgen.reference.status import Status, StepError


@dataclass(frozen=True)
class Cloud:
    """N points around an estimate.

    weights: what they weigh. points (N, n): where functions are evaluated, within the states' bounds, angles not
    wrapped. noise (N, q): the values of the carried noises that belong to them. deviations (N, n): of the points
    from the mean, before they were brought within the bounds; errors, drift (n): bounds of their rounding, as in
    Spread. rest (n, n): P less the weighted squares of the deviations.
    """

    weights: PointSet
    points: Matrix
    noise: Matrix
    deviations: Matrix
    errors: Vector
    drift: Vector
    rest: Matrix


class Drawing:
    """Draws the sigma points of a spec."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.rule = SigmaRule(model)
        self._root = ROOTS[model.spec.filter.covariance]

    def draw(self, x: Vector, P: Matrix, C: Matrix) -> Cloud:
        """Points of x (n), P (n, n) and of the carried noises, mean 0, covariance C (q, q).

        The bounds move the places where functions are evaluated, not the deviations: weighted with those, P and
        the covariances of whatever is computed at the points remain the covariance of something.
        """
        n, root = self.model.n, self._root(P)
        weights = self.rule.points(n + len(C))
        deviations = weights.offsets[:, :n] @ root.T
        moment = np.eye(n) - weights.moment[:n, :n]
        rest = root @ moment @ root.T if np.any(moment) else np.zeros((n, n))
        return Cloud(
            weights,
            self.model.clip(x + deviations),
            weights.offsets[:, n:] @ self._root(C).T,
            deviations,
            np.zeros(n),
            np.zeros(n),
            rest,
        )


def average(
    images: Matrix, base: Vector, differences: Matrix, weights: PointSet, terms: Vector
) -> tuple[Vector, Spread]:
    """Mean (k) and spread of images (N, k), given their differences (N, k) from a base (k); terms (k): how large
    what is added up in an image may be, which bounds its rounding.

    The mean of differences is added to the base: where these are wrapped it is circular, right for negative
    weights, too; and images that are equal have no spread, not even by rounding.
    """
    shift = weights.wm @ differences
    size = np.max(np.abs(images), axis=0) + np.abs(base) + np.abs(weights.wm) @ np.abs(differences)
    errors = 4.0 * EPS * (size + terms)
    drift = np.sum(np.abs(weights.wm)) * errors
    return base + shift, spread(differences - shift, errors, drift, weights.wc)


def magnitude(jacobian: Callable[[Vector], Matrix], points: Matrix) -> Vector:
    """How large (k) the terms of a function's images may be that are added up in them: |J| |x|.

    Taken are the smallest entries of J among some of the points (N, n): a pole near one of them says nothing.
    """
    some = [np.abs(jacobian(points[i])) for i in (0, len(points) // 2, len(points) - 1)]
    slopes = np.fmin.reduce(some)
    terms: Vector = np.where(np.isfinite(slopes), slopes, 0.0) @ np.max(np.abs(points), axis=0)
    return terms


def centre(images: Matrix, weights: PointSet, bent: Sequence[bool], image: Callable[[], Vector]) -> Vector:
    """The base (k) of differences: the image of the centre point.

    Without one it is that of any point, and for bent components that of the mean, evaluated beside.
    Raises StepError NOT_FINITE.
    """
    if weights.centre is not None:
        base: Vector = images[weights.centre]
        return base
    base = images[0].copy()
    if any(bent):
        chosen = np.array(bent)
        base[chosen] = image()[chosen]
        if not np.isfinite(base).all():
            raise StepError(Status.NOT_FINITE)
    return base


def wrapped(differences: Matrix, model: Model) -> Matrix:
    """Differences of states (N, n), the periodic ones wrapped."""
    differences = differences.copy()
    for i, period in model.periods.items():
        differences[:, i] = [wrap(float(d), period) for d in differences[:, i]]
    return differences
