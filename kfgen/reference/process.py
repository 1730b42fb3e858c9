"""The process model: one step of the state, its Jacobians, and the covariance that the step adds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.errors import SpecError
from kfgen.reference.dual import Dual, Matrix, Number, Vector, hessian, jacobian, values, variables
from kfgen.reference.integrators import INTEGRATORS
from kfgen.reference.linalg import check_covariance, symmetric
from kfgen.reference.manifold import at_zero
from kfgen.reference.model import Context, Model
from kfgen.reference.reading import in_use
from kfgen.reference.status import Status, StepError

Numbers = list[Number]


@dataclass(frozen=True)
class Transition:
    """A linearised step: x (nx) the state after it, F (n, n) its Jacobian at the state before it, Q (n, n)
    what it adds to the covariance: the additive noise and that of all noise inputs."""

    x: Vector
    F: Matrix
    Q: Matrix


@dataclass(frozen=True)
class Disturbance:
    """What noises do to a step, unjudged. added (n, n): to the covariance, by the additive noise and by all noise
    inputs but the carried ones; carried (q, q): the covariance of these; given: the matrices of the spec that
    went into both."""

    added: Matrix
    carried: Matrix
    given: tuple[Matrix, ...]

    def judge(self) -> None:
        """Raises StepError NOT_POSITIVE where one of the spec's matrices is no covariance."""
        for matrix in self.given:
            check_covariance(matrix)


class Process:
    """The dynamics of a spec.

    In continuous form inputs, parameters, `t`, `dt` and the noises given by std or var are held at their
    values at the step's start through the whole step, whatever the integrator and the number of its
    substeps; the state at the end is differentiated through the integrator. Noises given by a density are
    zero along the way.
    """

    def __init__(self, model: Model) -> None:
        spec, dynamics = model.spec, model.spec.dynamics
        self.model = model
        self._continuous = dynamics.form == "continuous"
        self._integrator = dynamics.integrator
        self._substeps = dynamics.substeps
        # of a quaternion: its numbers after the step, or the three parts of the body's angular rate
        moving = model.errors if self._continuous else model.states
        self._f = [model.scope.compile(dynamics.f[name]) if name in dynamics.f else None for name in moving]
        self._Q = model.covariance(dynamics.Q, model.errors)
        self._Qw = model.noise_covariance(in_use(spec, spec.noise, dynamics.f.values()), spec.noise_covariance)
        names = [noise.name for noise in spec.noise]
        self._held = [i for i, noise in enumerate(spec.noise) if not noise.density]
        self._white = [i for i, noise in enumerate(spec.noise) if noise.density]
        self._names = names
        for i in self._held:
            for j in self._white:
                entry = None if spec.noise_covariance is None else spec.noise_covariance[i][j]
                if entry is not None and model.scope.constant(entry) != 0:
                    raise SpecError.at(entry.place, "a noise per step cannot be correlated with a density")

    def linearise(self, x: Vector, context: Context, additive: Matrix | None = None) -> Transition:
        """The step from x (nx), with Jacobians and covariances at x; additive: instead of the spec's own Q (n, n).

        F and G are those of the error: d(f(x [+] d, w) [-] f(x, 0)) by d and w at 0. Q = additive Q + G Qw G^T for
        the noises per step + for densities G Qc G^T dt with G = df/dw at x, or, with the exact integrator, the
        integral of expm(A s) G Qc G^T expm(A s)^T over the step (Van Loan 1978). Raises StepError: NOT_FINITE, or
        NOT_POSITIVE where Q or Qw is no covariance.
        """
        model, n = self.model, self.model.n
        environment = model.environment(context, x)
        Q, Qw = self._Q(environment) if additive is None else additive, self._Qw(environment)
        held = np.ix_(self._held, self._held)
        if self._continuous and self._integrator == "exact":
            x_next, F, G = self._exact(x, context)
        else:
            joint = at_zero(n + len(self._held))
            after = self._advance(model.space.plus(x.tolist(), joint[:n]), joint[n:], context)
            x_next = values(after)
            derivatives = jacobian(model.space.minus(after, x_next.tolist()), n + len(self._held))
            F, G = derivatives[:, :n], derivatives[:, n:]
        added = Q + G @ Qw[held] @ G.T
        if self._white:
            added = added + self._diffusion(x, Qw[np.ix_(self._white, self._white)], context)
        if not (np.isfinite(x_next).all() and np.isfinite(F).all() and np.isfinite(added).all()):
            raise StepError(Status.NOT_FINITE)
        check_covariance(Q)
        check_covariance(Qw)
        return Transition(model.space.normalised(x_next), F, symmetric(added))

    def advance(self, x: Vector, w: Vector, context: Context) -> Vector:
        """The state a step after x (nx), the noises per step at w (in the spec's order); may be NaN."""
        if self._continuous and self._integrator == "exact":
            return self._advance_exact(x, w, context)
        after = values(self._advance([float(v) for v in x], [float(v) for v in w], context))
        return self.model.space.normalised(after)

    def expand(self, x: Vector, context: Context) -> Numbers:
        """The states after a step as second-order Duals in the joint variables (x, noises per step)."""
        joint = variables([*x, *np.zeros(len(self._held))], order=2)
        if self._continuous and self._integrator == "exact":
            return self._expand_exact(x, joint, context)
        return self._advance(joint[: self.model.n], joint[self.model.n :], context)

    def jacobian(self, x: Vector, context: Context) -> Matrix:
        """F (n, n) at x (n); may be NaN."""
        still = np.zeros(len(self._held))
        if self._continuous and self._integrator == "exact":
            return self._exact(x, context)[1]
        space = self.model.space
        after = self._advance(space.around(x), [float(v) for v in still], context)
        return jacobian(space.minus(after, values(after).tolist()), self.model.n)

    def disturbance(self, x: Vector, context: Context, carried: Sequence[str]) -> Disturbance:
        """The noises of a step from x (n), some of them carried by sigma points. Raises StepError NOT_FINITE.

        No derivative by the states is taken: f may have none at x.
        """
        names = [self._names[i] for i in self._held]
        own = [names.index(name) for name in carried]
        rest = [i for i in range(len(names)) if i not in own]
        environment = self.model.environment(context, x)
        Q, Qw = self._Q(environment), self._Qw(environment)
        held = Qw[np.ix_(self._held, self._held)]
        added = Q
        if rest:
            w: Numbers = [0.0] * len(names)
            for i, variable in zip(rest, at_zero(len(rest)), strict=True):
                w[i] = variable
            if self._continuous and self._integrator == "exact":
                G = self._exact(x, context)[2][:, rest]
            else:
                after = self._advance([float(v) for v in x], w, context)
                G = jacobian(self.model.space.minus(after, values(after).tolist()), len(rest))
            added = added + G @ held[np.ix_(rest, rest)] @ G.T
        if self._white:
            added = added + self._diffusion(x, Qw[np.ix_(self._white, self._white)], context)
        if not (np.isfinite(added).all() and np.isfinite(Qw).all()):
            raise StepError(Status.NOT_FINITE)
        return Disturbance(symmetric(added), held[np.ix_(own, own)], (Q, Qw))

    def held_covariance(self, x: Vector, context: Context) -> Matrix:
        """The covariance of the noises per step, in the spec's order, at x (n)."""
        return self._Qw(self.model.environment(context, x))[np.ix_(self._held, self._held)]

    def _rate(self, x: Sequence[Number], held: Sequence[Number], white: Sequence[Number], context: Context) -> Numbers:
        """The formulas of f at (x, noises): dx/dt, of a quaternion the body's angular rate (k numbers), in continuous
        form, else the next state (n numbers)."""
        noise = {self._names[i]: number for i, number in zip(self._held, held, strict=True)}
        noise |= {self._names[i]: number for i, number in zip(self._white, white, strict=True)}
        environment = self.model.environment(context, x, noise)
        if self._continuous:
            return [0.0 if f is None else f(environment) for f in self._f]
        return [x[i] if f is None else f(environment) for i, f in enumerate(self._f)]

    def _advance(self, x: Numbers, w: Numbers, context: Context) -> Numbers:
        still = [0.0] * len(self._white)
        if not self._continuous:
            return self._rate(x, w, still, context)
        step = INTEGRATORS[self._integrator]
        h = context.dt / self._substeps
        for _ in range(self._substeps):
            x = step(lambda state: self._rate(state, w, still, context), x, h, self.model.space)
        return x

    def _rate_jacobians(self, x: Vector, context: Context) -> tuple[Vector, Matrix, Matrix, Matrix]:
        """The rate (n), and its Jacobians by x as the body sees it (n), by the noises per step, by the densities, all
        noises at 0."""
        n, a, b = self.model.n, len(self._held), len(self._white)
        joint = at_zero(n + a + b)
        around = self.model.space.along(x.tolist(), joint[:n])
        rate = self._rate(around, joint[n : n + a], joint[n + a :], context)
        derivatives = jacobian(rate, n + a + b)
        return values(rate), derivatives[:, :n], derivatives[:, n : n + a], derivatives[:, n + a :]

    def _exact(self, x: Vector, context: Context) -> tuple[Vector, Matrix, Matrix]:
        """x after the step, F and G of dx/dt = A x + B w + c with w = 0 and c held, by one matrix exponential.

        expm([[A, B, c], [0, 0, 0]] dt) = [[F, G, d], [0, I, 0]] (Van Loan 1978, equation 1.2). Quaternions turn at a
        constant rate: the error that the body sees then has constant coefficients too.
        """
        n, a, space = self.model.n, len(self._held), self.model.space
        rate, A, B, _ = self._rate_jacobians(x, context)
        generator = np.zeros((n + a + 1, n + a + 1))
        generator[:n] = np.column_stack([space.turning(A, rate), B, self._offset(x, A, rate)])
        exponential = expm(_finite(generator * context.dt))
        F, G = exponential[:n, :n], exponential[:n, n : n + a]
        after = self._after(x, exponential, rate * context.dt)
        end = space.from_body(after)
        return after, end @ F @ space.from_body(x).T, end @ G

    def _advance_exact(self, x: Vector, w: Vector, context: Context) -> Vector:
        """x after the step of dx/dt = A x + b(w) with w held: expm([[A, b], [0, 0]] dt) times (x, 1)."""
        n, space = self.model.n, self.model.space
        around = space.along(x.tolist(), at_zero(n))
        rates = self._rate(around, [float(v) for v in w], [0.0] * len(self._white), context)
        A, rate, generator = jacobian(rates, n), values(rates), np.zeros((n + 1, n + 1))
        generator[:n] = np.column_stack([space.turning(A, rate), self._offset(x, A, rate)])
        if not np.isfinite(generator).all():
            return np.full(self.model.nx, math.nan)
        return self._after(x, expm(generator * context.dt), rate * context.dt)

    def _offset(self, x: Vector, A: Matrix, rate: Vector) -> Vector:
        """c (n) of dx/dt = A x + c; 0 for rotations."""
        flat = self.model.space.flat(x)
        offset: Vector = np.where(self.model.space.real, rate - A @ flat, 0.0)
        return offset

    def _after(self, x: Vector, exponential: Matrix, turn: Vector) -> Vector:
        """x (nx) after an exact step: numbers by the exponential of the generator, quaternions by their turn (n)."""
        n, space = self.model.n, self.model.space
        moved: Vector = exponential[:n, :n] @ space.flat(x) + exponential[:n, -1]
        after = space.along(x.tolist(), turn.tolist())
        for block in space.blocks:
            if block.rotation is None:
                after[block.number] = moved[block.error]
        return space.normalised(values(after))

    def _expand_exact(self, x: Vector, joint: Numbers, context: Context) -> Numbers:
        """The exact step bends only where a held noise enters dx/dt in a nonlinear way: by
        (integral of expm(A s) over the step) times the second derivatives of dx/dt."""
        n, k = self.model.n, len(joint)
        x_next, F, G = self._exact(x, context)
        A = self._rate_jacobians(x, context)[1]
        generator = np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]])
        integral = expm(_finite(generator * context.dt))[:n, n:]
        rate = self._rate(joint[:n], joint[n:], [0.0] * len(self._white), context)
        bends = np.array([hessian(number, k) for number in rate])
        bends = np.einsum("ij,jkl->ikl", integral, bends)
        return [Dual(float(x_next[i]), np.concatenate([F[i], G[i]]), bends[i]) for i in range(n)]

    def _diffusion(self, x: Vector, Qc: Matrix, context: Context) -> Matrix:
        """What the densities Qc add to the covariance over the step."""
        n, space = self.model.n, self.model.space
        rate, A, _, G = self._rate_jacobians(x, context)
        spread = G @ Qc @ G.T
        if self._integrator != "exact":
            start = space.from_body(x)
            added: Matrix = start @ spread @ start.T * context.dt
            return added
        # Van Loan 1978, equations 1.2 and 2.1: expm([[-A, C], [0, A^T]] dt) = [[., F^-1 Q], [0, F^T]]
        A = space.turning(A, rate)
        generator = np.block([[-A, spread], [np.zeros((n, n)), A.T]])
        exponential = expm(_finite(generator * context.dt))
        integral: Matrix = exponential[n:, n:].T @ exponential[:n, n:]
        end = space.from_body(values(space.along(x.tolist(), (rate * context.dt).tolist())))
        return np.asarray(end @ integral @ end.T, dtype=np.float64)


def _finite(matrix: Matrix) -> Matrix:
    if not np.isfinite(matrix).all():
        raise StepError(Status.NOT_FINITE)
    return matrix


def expm(A: Matrix) -> Matrix:
    """The exponential of a square matrix; of scipy, which takes long to load and is used by `exact` alone."""
    from scipy.linalg import expm as exponential

    result: Matrix = exponential(A)
    return result
