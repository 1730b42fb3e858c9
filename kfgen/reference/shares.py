"""A linearised step whose covariance is told by where it comes from."""

from __future__ import annotations

import numpy as np

from kfgen.reference.dual import Matrix, Vector, jacobian, values
from kfgen.reference.linalg import udu
from kfgen.reference.manifold import at_zero
from kfgen.reference.model import Context
from kfgen.reference.process import Process


def sources(process: Process) -> tuple[str, ...]:
    """What may add to the covariance in a step: each noise input, and the additive noise of each error."""
    spec = process.model.spec
    return (*(f"noise.{noise.name}" for noise in spec.noise), *(f"Q.{name}" for name in spec.errors))


def shares(process: Process, x: Vector, context: Context) -> tuple[Matrix, Matrix]:
    """F (n, n) at x (nx), and what each of the `sources` adds (s, n, n): they sum up to `Process.linearise`'s Q.

    A full matrix is told apart by Q = U D U^T: the noise of D_j is that of entry j, and acts on those above it too.
    Raises StepError NOT_POSITIVE where a matrix is no covariance.
    """
    model, n = process.model, process.model.n
    environment = model.environment(context, x)
    Q, Qw = process._Q(environment), process._Qw(environment)
    held = process._held
    if process._continuous and process._integrator == "exact":
        _, F, G = process._exact(x, context)
    else:
        space, joint = model.space, at_zero(n + len(held))
        after = process._advance(space.plus(x.tolist(), joint[:n]), joint[n:], context)
        derivatives = jacobian(space.minus(after, values(after).tolist()), n + len(held))
        F, G = derivatives[:, :n], derivatives[:, n:]
    noises = len(process._names)
    added = np.zeros((noises + n, n, n))
    for i, term in zip(held, _terms(Qw[np.ix_(held, held)]), strict=True):
        added[i] = G @ term @ G.T
    white = process._white
    for i, term in zip(white, _terms(Qw[np.ix_(white, white)]), strict=True):
        if term.any():
            added[i] = process._diffusion(x, term, context)
    for i, term in enumerate(_terms(Q)):
        added[noises + i] = term
    return F, added


def _terms(P: Matrix) -> list[Matrix]:
    """Positive semidefinite matrices that sum up to P, one for each of its entries."""
    if not P.any():
        return [P] * len(P)
    U, D = udu(P)
    return [D[j] * np.outer(U[:, j], U[:, j]) for j in range(len(P))]
