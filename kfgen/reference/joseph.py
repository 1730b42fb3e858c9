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
from kfgen.reference.linalg import EPS, symmetric, udu
from kfgen.reference.status import Status, StepError

# Beyond this condition number of the scaled innovation covariance the components are processed one by one:
# what solving with it loses stays below 1e-12.
_WELL_CONDITIONED = 1e4


@dataclass(frozen=True)
class Update:
    """What a linear update makes of an estimate.

    dx (n): correction of the state. P (n, n): the new covariance. nis: y^T S^-1 y over the components in
    use. log_likelihood: ln N(y; 0, S) over the same.
    """

    dx: Vector
    P: Matrix
    nis: float
    log_likelihood: float


def update(P: Matrix, H: Matrix, R: Matrix, y: Vector) -> Update:
    """The update of covariance P (n, n) by the innovation y (m) with H (m, n) and R (m, m).

    R must be positive semidefinite: a negative pivot raises NOT_POSITIVE.
    """
    _, D = udu(R)
    S = symmetric(H @ P @ H.T + R)
    if len(y) > 1 and np.all(D > 0.0) and np.all(S.diagonal() > 0.0):
        root = np.sqrt(S.diagonal())
        if np.linalg.cond(S / np.outer(root, root)) <= _WELL_CONDITIONED:
            return batch(P, H, R, y)
    return sequential(P, H, R, y)


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


def sequential(P: Matrix, H: Matrix, R: Matrix, y: Vector) -> Update:
    """The components one by one, after decorrelation by R = U diag(r) U^T (Bierman 1977, section V.2).

    The innovation of component i is y_i - H_i dx, dx being the correction made by those before it. A
    component with r = 0 along a direction that is already known exactly (s = 0 to round-off) is skipped: it
    adds nothing to nis or to the likelihood. An innovation variance below that raises NOT_POSITIVE.
    """
    U, r = udu(R)
    rows = np.linalg.solve(U, H)
    innovations = np.linalg.solve(U, y)
    dx = np.zeros(len(P))
    nis = log_likelihood = 0.0
    for h, variance, innovation in zip(rows, r, innovations, strict=True):
        known = 8.0 * len(P) * EPS * float(np.abs(h) @ np.abs(P) @ np.abs(h))
        c = float(h @ P @ h)
        if c < -known:
            raise StepError(Status.NOT_POSITIVE)
        if variance == 0.0 and c <= known:
            continue
        # within round-off of 0 the variance of h x is 0: what is left of it must not become a gain
        c = max(c, 0.0)
        s = c + variance
        K = P @ h / s
        nu = float(innovation - h @ dx)
        P = _joseph(P, K, h, float(variance))
        dx = dx + K * nu
        nis += nu * nu / s
        log_likelihood -= 0.5 * (math.log(2.0 * math.pi) + nu * nu / s + math.log(s))
    return Update(dx, P, nis, log_likelihood)


def _joseph(P: Matrix, K: Vector, h: Vector, r: float) -> Matrix:
    """(I - K h) P (I - K h)^T + r K K^T for one component with variance r."""
    A = np.eye(len(P)) - np.outer(K, h)
    updated = symmetric(A @ P @ A.T + r * np.outer(K, K))
    if r == 0.0:
        # An exact measurement can leave a variance of 0, of which float64 leaves the square of a rounding
        # error. Below that bound a variance is nothing but rounding, and is made the 0 that it stands for.
        size = np.eye(len(P)) + np.abs(np.outer(K, h))
        bound = (8.0 * len(P) * EPS) ** 2 * np.einsum("ij,jk,ik->i", size, np.abs(P), size)
        gone = updated.diagonal() <= bound
        updated[gone, :] = 0.0
        updated[:, gone] = 0.0
    return updated
