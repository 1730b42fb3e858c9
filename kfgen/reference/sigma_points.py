"""Sigma points: where they lie, in units of a root of the covariance, and what they weigh.

Julier & Uhlmann 2004 (julier), van der Merwe 2004 (merwe), Wan & van der Merwe 2000 in the form of the
unscented transform's encyclopaedia article (wiki), Arasaratnam & Haykin 2009 (cubature).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import EPS
from kfgen.reference.model import Model
from kfgen.spec.tree import Expression


@dataclass(frozen=True)
class PointSet:
    """N points in L dimensions of unit variance.

    offsets (N, L): from the mean. wm (N), wc (N): their weights in means and covariances. centre: the row of
    the point at the mean, None where the set has none. shift: beta - alpha^2 of merwe and wiki, else None.
    """

    offsets: Matrix
    wm: Vector
    wc: Vector
    centre: int | None
    shift: float | None = None

    @property
    def others(self) -> Vector:
        """wm (N) with 0 for the point at the mean."""
        return np.array([0.0 if i == self.centre else w for i, w in enumerate(self.wm)])

    @property
    def negative(self) -> bool:
        """Whether a covariance is gathered with negative weights."""
        return bool(np.any(self.wc < 0.0)) if self.shift is None else self.shift < 0.0

    @property
    def exact(self) -> bool:
        """Whether the points have the covariance that they are drawn of: custom ones may have another."""
        moment = (self.wc[:, None] * self.offsets).T @ self.offsets
        return self.shift is not None or np.allclose(moment, np.eye(len(moment)), atol=1e-12)


@dataclass(frozen=True)
class Images:
    """What points became: base the image of the point at the mean; e (N, k): their differences from it, k the number of
    its errors; d (k): the mean of these."""

    weights: PointSet
    base: Vector
    e: Matrix
    d: Vector

    @property
    def deviations(self) -> Matrix:
        """From the mean (N, k)."""
        return self.e - self.d

    def moved(self, T: Matrix) -> Images:
        """As seen from elsewhere: T (k, k) takes differences there."""
        return replace(self, e=self.e @ T.T, d=T @ self.d)

    def covariance(self, other: Images) -> Matrix:
        """Their covariance (k, l) with those of the same points elsewhere: sum wc dX dY^T.

        Of merwe and wiki as w sum e_i e_i^T + (beta - alpha^2) d d^T, which is the same without weights of
        -1/alpha^2.
        """
        weights = self.weights
        if weights.shift is None:
            return (weights.wc[:, None] * self.deviations).T @ other.deviations
        return (weights.others[:, None] * self.e).T @ other.e + weights.shift * np.outer(self.d, other.d)

    @property
    def size(self) -> Vector:
        """The absolute values (k) of what is added up in the variances."""
        weights = self.weights
        if weights.shift is None:
            return np.abs(weights.wc) @ self.deviations**2
        return weights.others @ self.e**2 + abs(weights.shift) * self.d**2


class SigmaRule:
    """The rule of a spec for its sigma points; own: whether they are custom, and so of n dimensions only."""

    def __init__(self, model: Model) -> None:
        points = model.spec.filter.sigma_points
        assert points is not None
        self._kind = points.kind
        self.own = points.kind == "custom"
        self._alpha, self._beta, self._kappa = (
            None if entry is None else model.number(entry) for entry in (points.alpha, points.beta, points.kappa)
        )
        self._shift = None if self._alpha is None or self._beta is None else self._beta - self._alpha**2
        self._sets: dict[int, PointSet] = {}
        if self.own:
            assert points.points is not None
            assert points.wm is not None
            assert points.wc is not None
            offsets = np.array([_numbers(model, row) for row in points.points])
            centres = np.flatnonzero(~np.any(offsets, axis=1))
            centre = int(centres[0]) if len(centres) else None
            wm, wc = _numbers(model, points.wm), _numbers(model, points.wc)
            self._sets[model.n] = PointSet(offsets, wm, wc, centre)

    def points(self, dimensions: int) -> PointSet:
        """The points in so many dimensions, L: x, then x + and x - the columns of sqrt(gamma) times the root."""
        if dimensions not in self._sets:
            self._sets[dimensions] = self._symmetric(dimensions)
        return self._sets[dimensions]

    def _symmetric(self, L: int) -> PointSet:
        gamma, wm0, wc0, wm, wc = self._weights(L)
        columns = np.sqrt(gamma) * np.eye(L)
        if self._kind == "cubature":
            return PointSet(np.vstack([columns, -columns]), np.full(2 * L, wm), np.full(2 * L, wc), None)
        offsets = np.vstack([np.zeros((1, L)), columns, -columns])
        means, spreads = np.full(2 * L + 1, wm), np.full(2 * L + 1, wc)
        means[0], spreads[0] = wm0, wc0
        return PointSet(offsets, means, spreads, 0, self._shift)

    def _weights(self, L: int) -> tuple[float, float, float, float, float]:
        """gamma, the weights of the centre, those of the others."""
        if self._kind == "trivial":
            return L, 1.0 / (2.0 * L + 1.0), 0.5 / L, 1.0 / (2.0 * L + 1.0), 0.5 / L
        if self._kind == "cubature":
            return L, 0.0, 0.0, 0.5 / L, 0.5 / L
        kappa = L if self._kappa is None else self._kappa
        if self._kind == "julier":
            gamma = L + kappa
            return gamma, kappa / gamma, kappa / gamma, 0.5 / gamma, 0.5 / gamma
        assert self._alpha is not None
        assert self._beta is not None
        # merwe: gamma = lambda + L with lambda = alpha^2 (L + kappa) - L
        gamma = self._alpha**2 * (kappa if self._kind == "wiki" else L + kappa)
        wm0 = (gamma - L) / gamma
        return gamma, wm0, wm0 + 1.0 - self._alpha**2 + self._beta, 0.5 / gamma, 0.5 / gamma


def _numbers(model: Model, row: tuple[Expression, ...]) -> Vector:
    return np.array([model.number(entry) for entry in row])


def upper_root(P: Matrix) -> Matrix:
    """U sqrt(D) (n, n) of P = U D U^T, U unit upper triangular (Bierman 1977, section III.3).

    A pivot of at most 8 n eps P_jj is 0, a direction without spread, and has a zero column. Definiteness is not
    judged here: a negative pivot counts as 0.
    """
    n = len(P)
    rest, root = P.copy(), np.zeros((n, n))
    for j in range(n - 1, -1, -1):
        pivot = rest[j, j]
        if pivot > 8.0 * n * EPS * P[j, j]:
            root[: j + 1, j] = rest[: j + 1, j] / np.sqrt(pivot)
            rest[:j, :j] -= np.outer(rest[:j, j], rest[:j, j]) / pivot
    return root


def lower_root(P: Matrix) -> Matrix:
    """The lower Cholesky factor (n, n) of P, with the same care."""
    flip = slice(None, None, -1)
    return upper_root(P[flip, flip])[flip, flip]


ROOTS = {"ud": upper_root, "full": lower_root, "sqrt": lower_root}
