"""The linear measurement update in Joseph's form: for a whole vector, and component by component.

Both give the same numbers. The whole vector needs a well-conditioned, positive definite innovation
covariance; the sequence needs nothing: it is the one that defines what happens for R = 0, P = 0 and sensors
that repeat each other exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.influence import Influence
from kfgen.reference.linalg import EPS, symmetric, udu
from kfgen.reference.status import Status, StepError

# Beyond this condition number of the scaled innovation covariance the components are processed one by one:
# what solving with it loses stays below 1e-12.
_WELL_CONDITIONED = 1e4


@dataclass(frozen=True)
class Update:
    """What a linear update makes of an estimate.

    dx (n): correction of the state. P (n, n): the new covariance. nis, log_likelihood: y^T S^-1 y and
    ln N(y; 0, S) over the components in use, or, where the Rules change anything, the sums of nu^2 / s and of
    the logarithms over the scalars as they were processed. flags: what the Rules raised. steps (k, n): the
    corrections K_i nu_i of the scalars, where they were processed one by one.
    """

    dx: Vector
    P: Matrix
    nis: float
    log_likelihood: float
    flags: Status = Status.OK
    steps: Matrix | None = None


@dataclass(frozen=True)
class Rules:
    """What is done to each scalar measurement beside the textbook's update.

    influence: the innovation's influence function. chi2: the threshold above which the covariance is
    inflated. floor: smallest innovation variance. limit: largest |K_i|. consider: states whose gain is 0.
    one_by_one: process scalars even where the whole vector would do, for the sake of `Update.steps`.
    """

    influence: Influence | None = None
    chi2: float | None = None
    floor: float = 0.0
    limit: float = math.inf
    consider: tuple[int, ...] = ()
    one_by_one: bool = False


PLAIN = Rules()


def update(P: Matrix, H: Matrix, R: Matrix, y: Vector, rules: Rules = PLAIN) -> Update:
    """The update of covariance P (n, n) by the innovation y (m) with H (m, n) and R (m, m).

    R must be positive semidefinite: a negative pivot raises NOT_POSITIVE.
    """
    _, D = udu(R)
    S = symmetric(H @ P @ H.T + R)
    if rules == PLAIN and len(y) > 1 and (D > 0.0).all() and (S.diagonal() > 0.0).all():
        root = np.sqrt(S.diagonal())
        if np.linalg.cond(S / np.outer(root, root)) <= _WELL_CONDITIONED:
            return batch(P, H, R, y)
    return sequential(P, H, R, y, rules)


def batch(P: Matrix, H: Matrix, R: Matrix, y: Vector) -> Update:
    """The whole vector at once: K = P H^T S^-1, P <- (I - K H) P (I - K H)^T + K R K^T.

    Bucy & Joseph 1968; Bar-Shalom, Li & Kirubarajan 2001, equations 5.2.3-8 to 5.2.3-18. S must be regular.
    """
    S = symmetric(H @ P @ H.T + R)
    K = np.linalg.solve(S, H @ P).T
    A = np.eye(len(P)) - K @ H
    nis = float(y @ np.linalg.solve(S, y))
    log_det = float(np.linalg.slogdet(S)[1])
    return Update(
        dx=K @ y,
        P=symmetric(A @ P @ A.T + K @ R @ K.T),
        nis=nis,
        log_likelihood=-0.5 * (len(y) * math.log(2.0 * math.pi) + nis + log_det),
    )


def sequential(P: Matrix, H: Matrix, R: Matrix, y: Vector, rules: Rules = PLAIN) -> Update:
    """The components one by one, after decorrelation by R = U diag(r) U^T (Bierman 1977, section V.2).

    The innovation nu of component i is y_i - H_i dx, dx being the correction made by those before it. With
    c = h P h^T each scalar is treated in this order:

    * robust: nu <- sigma psi(nu / sigma) with sigma = sqrt(r), and g = psi' its weight; s = r + g c (a
      generalised linear model: Fahrmeir & Kaufmann 1991). An exact measurement (r = 0) is believed.
    * adaptive: where g nu^2 / chi2 > s, P <- a P with the a that makes s the left side; not where c = 0.
    * a floor of s, to which r is raised.
    * K = P h^T / s, held at 0 for considered states (Schmidt 1966), limited; P in Joseph's form with that K.

    A component with r = 0 along a direction that is already known exactly (c = 0 to round-off) is skipped,
    unless there is a floor: it adds nothing to nis, to the likelihood, or to the flags. A variance c below 0 is
    rounding, and counts as 0.
    """
    U, variances = udu(R)
    rows = np.linalg.solve(U, H)
    innovations = np.linalg.solve(U, y)
    dx = np.zeros(len(P))
    steps = []
    nis = log_likelihood = 0.0
    flags = Status.OK
    for h, r, innovation in zip(rows, map(float, variances), innovations, strict=True):
        known = 8.0 * len(P) * EPS * float(np.abs(h) @ np.abs(P) @ np.abs(h))
        c = float(h @ P @ h)
        if r == 0.0 and c <= known and rules.floor == 0.0:
            continue
        # within round-off of 0 the variance of h x is 0: what is left of it must not become a gain
        certain, c = c <= known, max(c, 0.0)
        nu, g = float(innovation - h @ dx), 1.0
        if rules.influence is not None and r > 0.0:
            nu, g, glitch = _weighed(nu, math.sqrt(r), rules.influence)
            flags |= glitch
        s = r + g * c
        if rules.chi2 is not None and not certain and g * c > 0.0 and g * nu * nu / rules.chi2 > s:
            inflation = 1.0 + (g * nu * nu / rules.chi2 - s) / (g * c)
            P, c = inflation * P, inflation * c
            s = r + g * c
            flags |= Status.ANOMALY
        if not math.isfinite(s):
            raise StepError(Status.NOT_FINITE)
        if s < rules.floor:
            r, s = r + rules.floor - s, rules.floor
            flags |= Status.REGULARIZED
        K = P @ h / s
        K[list(rules.consider)] = 0.0
        if np.any(np.abs(K) > rules.limit):
            flags |= Status.REGULARIZED
        K = np.clip(K, -rules.limit, rules.limit)
        P = _joseph(P, K, h, r, g)
        steps.append(K * nu)
        dx = dx + K * nu
        nis += nu * nu / s
        log_likelihood -= 0.5 * (math.log(2.0 * math.pi) + nu * nu / s + math.log(s))
    return Update(dx, P, nis, log_likelihood, flags, np.array(steps).reshape(-1, len(P)))


def _weighed(nu: float, sigma: float, influence: Influence) -> tuple[float, float, Status]:
    """sigma psi(nu / sigma), its weight g, and the flag that says how far the innovation was doubted."""
    psi, g = influence(nu / sigma)
    if g == 0.0:
        return sigma * psi, g, Status.GLITCH_LARGE
    return sigma * psi, g, Status.GLITCH_SMALL if g < 1.0 else Status.OK


def _joseph(P: Matrix, K: Vector, h: Vector, r: float, g: float = 1.0) -> Matrix:
    """(I - g K h) P (I - g K h)^T + g r K K^T for one component with variance r and weight g.

    It holds for every K; with K = P h^T / s it is P - g s K K^T.
    """
    A = np.eye(len(P)) - g * np.outer(K, h)
    updated = symmetric(A @ P @ A.T + g * r * np.outer(K, K))
    if r == 0.0:
        # An exact measurement can leave a variance of 0, of which float64 leaves the square of a rounding
        # error. Below that bound a variance is nothing but rounding, and is made the 0 that it stands for.
        size = np.eye(len(P)) + np.abs(np.outer(K, h))
        bound = (8.0 * len(P) * EPS) ** 2 * np.einsum("ij,jk,ik->i", size, np.abs(P), size)
        gone = updated.diagonal() <= bound
        updated[gone, :] = 0.0
        updated[:, gone] = 0.0
    return updated
