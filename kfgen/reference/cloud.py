"""Sigma points of an estimate, drawn from it or kept from a prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.model import Model
from kfgen.reference.sigma_points import ROOTS, Images, PointSet, SigmaRule


@dataclass(frozen=True)
class Cloud:
    """N points around an estimate.

    points (N, nx): where functions are evaluated, within the states' bounds, angles not wrapped. noise (N, q): the
    values of the carried noises that belong to them. states: the points as they are averaged, before they were
    brought within the bounds.
    """

    points: Matrix
    noise: Matrix
    states: Images

    @property
    def weights(self) -> PointSet:
        return self.states.weights

    @property
    def noises(self) -> Images:
        """The noises as they are averaged: their mean is 0."""
        none = np.zeros(self.noise.shape[1])
        return Images(self.weights, none, self.noise, none)


class Drawing:
    """Draws the sigma points of a spec."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.rule = SigmaRule(model)
        self._root = ROOTS[model.spec.filter.covariance]

    def draw(self, x: Vector, P: Matrix, C: Matrix) -> Cloud:
        """Points of x (nx), P (n, n) and of the carried noises, mean 0, covariance C (q, q).

        The bounds move the places where functions are evaluated, not the deviations: weighted with those, P and
        the covariances of whatever is computed at the points remain the covariance of something.
        """
        n, space = self.model.n, self.model.space
        weights = self.rule.points(n + len(C))
        deviations = weights.offsets[:, :n] @ self._root(P).T
        noise = weights.offsets[:, n:] @ self._root(C).T
        points = np.array([self.model.clip(space.moved(x, deviation)) for deviation in deviations])
        return Cloud(points, noise, Images(weights, x, deviations, np.zeros(n)))
