"""Sigma points as a filter needs them: weights, and how a covariance is gathered from deviations.

With e_k = X_k - X_0, X_0 the image of the centre, and d = sum wm_k e_k the shift of the mean from it,

    sum wc_k (X_k - mean)(..)^T = sum wc (e_k - theta d)(..)^T + extra d d^T, k >= 1

for equal weights of all points but the centre. Of merwe and wiki theta is 0 and extra beta - alpha^2: weights of
-1/alpha^2 cancel out, and nothing is subtracted where beta >= alpha^2. Of the others theta is 1 and extra the centre's
own weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra.numbers import constant_root
from kfgen.model.options import Points


@dataclass(frozen=True)
class PointSet:
    """Points of L dimensions other than the centre.

    rows: their coefficients of the root's columns (count, L). wm, wc: their weights, one for all or one each. centre:
    whether the set has a point at the mean. wc0: its weight in covariances. theta, extra: see above. exact: whether
    second moments of the points are those of the covariance, and their mean is 0, so that a linear function needs no
    points. symmetric: the points are pairs, +- along one column of the root each.
    """

    rows: list[list[Fraction]]
    wm: list[Fraction]
    wc: list[Fraction]
    centre: bool
    wc0: Fraction
    theta: int
    extra: Fraction
    exact: bool
    symmetric: bool

    @property
    def uniform(self) -> bool:
        """Whether all points but the centre weigh the same."""
        return len(set(self.wm)) == 1 and len(set(self.wc)) == 1

    @property
    def balanced(self) -> bool:
        """Whether all weigh the same and lie evenly about the mean."""
        return self.uniform and not any(sum(column, Fraction(0)) for column in zip(*self.rows, strict=True))

    @property
    def positive(self) -> bool:
        """Whether whatever is gathered is positive semidefinite."""
        return self.extra >= 0 and all(w >= 0 for w in self.wc)


def point_set(options: Points, L: int) -> PointSet:
    """The points of a filter in L dimensions (algorithms: Julier & Uhlmann 2004; van der Merwe 2004;
    Arasaratnam & Haykin 2009)."""
    if options.kind == "custom":
        return _custom(options)
    gamma, wc0, wm, wc = _weights(options, L)
    reach = constant_root(gamma)
    rows = []
    for j in range(L):
        for sign in (1, -1):
            rows.append([sign * reach if i == j else Fraction(0) for i in range(L)])
    count = 2 * L
    scaled = options.kind in ("merwe", "wiki")
    theta, extra = (0, options.beta - options.alpha**2) if scaled else (1, wc0)
    return PointSet(rows, [wm] * count, [wc] * count, options.kind != "cubature", wc0, theta, extra, True, True)


def _weights(options: Points, L: int) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """gamma, the centre's weight in covariances, the weights of the others."""
    if options.kind == "trivial":
        return Fraction(L), Fraction(1, 2 * L), Fraction(1, 2 * L + 1), Fraction(1, 2 * L)
    if options.kind == "cubature":
        return Fraction(L), Fraction(0), Fraction(1, 2 * L), Fraction(1, 2 * L)
    kappa = Fraction(L) if options.kappa is None else options.kappa
    if options.kind == "julier":
        gamma = L + kappa
        return gamma, kappa / gamma, 1 / (2 * gamma), 1 / (2 * gamma)
    gamma = options.alpha**2 * (kappa if options.kind == "wiki" else L + kappa)
    return gamma, 2 - L / gamma - options.alpha**2 + options.beta, 1 / (2 * gamma), 1 / (2 * gamma)


def _custom(options: Points) -> PointSet:
    n = len(options.rows[0])
    found = [k for k, row in enumerate(options.rows) if not any(row)]
    centre = found[0] if found else None
    # those of positive weight first: what has been added can be taken away
    others = sorted((k for k in range(len(options.rows)) if k != centre), key=lambda k: options.wc[k] < 0)
    rows, wm, wc = options.rows, options.wm, options.wc
    close = Fraction(1, 10**12)
    moments = [
        [sum((w * r[i] * r[j] for w, r in zip(wc, rows, strict=True)), Fraction(0)) - (i == j) for j in range(n)]
        for i in range(n)
    ]
    means = [sum((w * r[i] for w, r in zip(wm, rows, strict=True)), Fraction(0)) for i in range(n)]
    exact = all(abs(v) < close for row in [*moments, means] for v in row)
    extra = Fraction(0) if centre is None else wc[centre]
    return PointSet(
        [list(rows[k]) for k in others], [wm[k] for k in others], [wc[k] for k in others],
        centre is not None, extra, 1, extra, exact, False,
    )  # fmt: skip
