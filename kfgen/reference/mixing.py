"""Mixtures of estimates: the moments that stand for them, and the probabilities that weigh them.

Blom & Bar-Shalom 1988; Bar-Shalom, Li & Kirubarajan 2001, section 11.6.6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kfgen.reference.algorithm import Estimate
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import symmetric
from kfgen.reference.model import Model, wrap
from kfgen.reference.status import Status, StepError


def moments(model: Model, estimates: Sequence[Estimate], weights: Vector) -> tuple[Vector, Matrix]:
    """The mean (nx) and covariance (n, n) of a mixture of B estimates with weights (B) that sum to 1.

    x = x_b [+] sum_i w_i (x_i [-] x_b), P = sum_i w_i (J_i P_i J_i^T + d_i d_i^T), d_i = x_i [-] x, where J_i moves
    errors at x_i to x. The base b is the estimate of
    the largest weight, the first of equals: estimates that agree give exactly what they agree on. Differences
    of periodic states from the base are wrapped, d_i are those less their mean, not wrapped again: so the d_i
    have the mean 0 that a spread is taken about. An estimate of weight 0 has no part in it. May be not finite.
    """
    space = model.space
    base = estimates[int(np.argmax(weights))].x
    part = [i for i, weight in enumerate(weights) if weight > 0.0]
    with np.errstate(all="ignore"):
        differences = [space.difference(estimates[i].x, base) for i in part]
        for difference in differences:
            for k, period in model.turns.items():
                difference[k] = wrap(float(difference[k]), period)
        shift = np.sum([weights[i] * difference for i, difference in zip(part, differences, strict=True)], axis=0)
        mean = space.moved(base, shift)
        P = np.zeros((model.n, model.n))
        for i, difference in zip(part, differences, strict=True):
            d, J = difference - shift, space.transport(estimates[i].x, mean)
            for block in space.rotations:
                d[block.errors] = space.difference(estimates[i].x, mean)[block.errors]
            P += weights[i] * (J @ estimates[i].P @ J.T + np.outer(d, d))
    return model.wrap(mean), symmetric(P)


def transition_rows(M: Matrix) -> Matrix:
    """M (B, B), each row divided by its sum. Raises StepError NOT_FINITE, or NOT_POSITIVE where an entry is
    negative or a row has nothing."""
    if not np.isfinite(M).all():
        raise StepError(Status.NOT_FINITE)
    sums = np.sum(M, axis=1)
    if np.any(M < 0.0) or np.any(sums == 0.0):
        raise StepError(Status.NOT_POSITIVE)
    rows: Matrix = M / sums[:, None]
    return rows


def mixing(M: Matrix, mu: Vector) -> tuple[Matrix, Vector]:
    """w (B, B) and c (B): c_j = sum_i M_ij mu_i, the probability of mode j now, and w_ij = M_ij mu_i / c_j, that
    of mode i before, given mode j now; where c_j = 0 column j of w is 0. M has rows that sum to 1."""
    joint = M * mu[:, None]
    c = np.sum(joint, axis=0)
    return np.divide(joint, c, out=np.zeros_like(joint), where=c > 0.0), c


def weighed(mu: Vector, log_likelihoods: Vector, floor: float) -> tuple[Vector, float]:
    """The probabilities (B) of the modes given their log-likelihoods (B) of a reading, and the log-likelihood of
    the bank, ln sum_j mu_j exp(l_j). No probability is left below the floor, but for what normalising takes.

    The largest l_j is taken out before exp: that of the modes which have a probability at all, so that the sum is
    at least this mode's. Raises StepError NOT_FINITE.
    """
    alive = mu > 0.0
    largest = float(np.max(log_likelihoods[alive]))
    if not math.isfinite(largest) or np.any(np.isnan(log_likelihoods)):
        raise StepError(Status.NOT_FINITE)
    terms = np.zeros(len(mu))
    terms[alive] = mu[alive] * np.exp(log_likelihoods[alive] - largest)
    total = float(np.sum(terms))
    raised = np.maximum(terms / total, floor)
    return raised / np.sum(raised), largest + math.log(total)
