"""The process model: one step of the state, its Jacobians, and the covariance that the step adds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.errors import SpecError
from kfgen.reference.dual import Dual, Matrix, Number, Vector, hessian, jacobian, values, variables
from kfgen.reference.linalg import check_covariance, symmetric
from kfgen.reference.model import Context, Model
from kfgen.reference.reading import in_use
from kfgen.reference.status import Status, StepError

Numbers = list[Number]
Derivative = Callable[[Numbers], Numbers]


@dataclass(frozen=True)
class Transition:
    """A linearised step: x (n) the state after it, F (n, n) its Jacobian at the state before it, Q (n, n)
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
        self._f = [model.scope.compile(dynamics.f[name]) if name in dynamics.f else None for name in model.states]
        self._Q = model.covariance(dynamics.Q, model.states)
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
        """The step from x (n), with Jacobians and covariances at x; additive: instead of the spec's own Q (n, n).

        Q = additive Q + G Qw G^T for the noises per step, G = d x_next / dw, + for densities G Qc G^T dt with
        G = df/dw at x, or, with the exact integrator, the integral of expm(A s) G Qc G^T expm(A s)^T over the
        step (Van Loan 1978). Raises StepError: NOT_FINITE, or NOT_POSITIVE where Q or Qw is no covariance.
        """
        model, n = self.model, self.model.n
        environment = model.environment(context, x)
        Q, Qw = self._Q(environment) if additive is None else additive, self._Qw(environment)
        held = np.ix_(self._held, self._held)
        if self._continuous and self._integrator == "exact":
            x_next, F, G = self._exact(x, np.zeros(len(self._held)), context)
        else:
            joint = variables([*x, *np.zeros(len(self._held))])
            after = self._advance(joint[:n], joint[n:], context)
            derivatives = jacobian(after, n + len(self._held))
            x_next, F, G = values(after), derivatives[:, :n], derivatives[:, n:]
        added = Q + G @ Qw[held] @ G.T
        if self._white:
            added = added + self._diffusion(x, Qw[np.ix_(self._white, self._white)], context)
        if not (np.isfinite(x_next).all() and np.isfinite(F).all() and np.isfinite(added).all()):
            raise StepError(Status.NOT_FINITE)
        check_covariance(Q)
        check_covariance(Qw)
        return Transition(x_next, F, symmetric(added))

    def advance(self, x: Vector, w: Vector, context: Context) -> Vector:
        """The state a step after x (n), the noises per step at w (in the spec's order); may be NaN."""
        if self._continuous and self._integrator == "exact":
            return self._advance_exact(x, w, context)
        return values(self._advance([float(v) for v in x], [float(v) for v in w], context))

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
            return self._exact(x, still, context)[1]
        return jacobian(self._advance(variables(x), [float(v) for v in still], context), self.model.n)

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
            for i, variable in zip(rest, variables(np.zeros(len(rest))), strict=True):
                w[i] = variable
            if self._continuous and self._integrator == "exact":
                G = self._exact(x, np.zeros(len(names)), context)[2][:, rest]
            else:
                G = jacobian(self._advance([float(v) for v in x], w, context), len(rest))
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
        """The formulas of f at (x, noises): dx/dt in continuous form, else the next state."""
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
        step = _INTEGRATORS[self._integrator]
        h = context.dt / self._substeps
        for _ in range(self._substeps):
            x = step(lambda state: self._rate(state, w, still, context), x, h)
        return x

    def _rate_jacobians(self, x: Vector, context: Context) -> tuple[Vector, Matrix, Matrix, Matrix]:
        """dx/dt (n), and its Jacobians by x, by the noises per step, by the densities, all noises at 0."""
        n, a, b = self.model.n, len(self._held), len(self._white)
        joint = variables([*x, *np.zeros(a + b)])
        rate = self._rate(joint[:n], joint[n : n + a], joint[n + a :], context)
        derivatives = jacobian(rate, n + a + b)
        return values(rate), derivatives[:, :n], derivatives[:, n : n + a], derivatives[:, n + a :]

    def _exact(self, x: Vector, w: Vector, context: Context) -> tuple[Vector, Matrix, Matrix]:
        """x after the step, F and G of dx/dt = A x + B w + c with w and c held, by one matrix exponential.

        expm([[A, B, c], [0, 0, 0]] dt) = [[F, G, d], [0, I, 0]] (Van Loan 1978, equation 1.2).
        """
        n, a = self.model.n, len(self._held)
        rate, A, B, _ = self._rate_jacobians(x, context)
        generator = np.zeros((n + a + 1, n + a + 1))
        generator[:n] = np.column_stack([A, B, rate - A @ x])
        exponential = expm(_finite(generator * context.dt))
        F, G, d = exponential[:n, :n], exponential[:n, n : n + a], exponential[:n, -1]
        return F @ x + G @ w + d, F, G

    def _advance_exact(self, x: Vector, w: Vector, context: Context) -> Vector:
        """x after the step of dx/dt = A x + b(w) with w held: expm([[A, b], [0, 0]] dt) times (x, 1)."""
        n, still = self.model.n, [0.0] * len(self._white)
        rate = self._rate(variables(x), [float(v) for v in w], still, context)
        A, generator = jacobian(rate, n), np.zeros((n + 1, n + 1))
        generator[:n] = np.column_stack([A, values(rate) - A @ x])
        if not np.isfinite(generator).all():
            return np.full(n, math.nan)
        after: Vector = (expm(generator * context.dt) @ np.append(x, 1.0))[:n]
        return after

    def _expand_exact(self, x: Vector, joint: Numbers, context: Context) -> Numbers:
        """The exact step bends only where a held noise enters dx/dt in a nonlinear way: by
        (integral of expm(A s) over the step) times the second derivatives of dx/dt."""
        n, k = self.model.n, len(joint)
        x_next, F, G = self._exact(x, np.zeros(k - n), context)
        A = self._rate_jacobians(x, context)[1]
        generator = np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]])
        integral = expm(_finite(generator * context.dt))[:n, n:]
        rate = self._rate(joint[:n], joint[n:], [0.0] * len(self._white), context)
        bends = np.array([hessian(number, k) for number in rate])
        bends = np.einsum("ij,jkl->ikl", integral, bends)
        return [Dual(float(x_next[i]), np.concatenate([F[i], G[i]]), bends[i]) for i in range(n)]

    def _diffusion(self, x: Vector, Qc: Matrix, context: Context) -> Matrix:
        """What the densities Qc add to the covariance over the step."""
        n = self.model.n
        _, A, _, G = self._rate_jacobians(x, context)
        spread = G @ Qc @ G.T
        if self._integrator != "exact":
            added: Matrix = spread * context.dt
            return added
        # Van Loan 1978, equations 1.2 and 2.1: expm([[-A, C], [0, A^T]] dt) = [[., F^-1 Q], [0, F^T]]
        generator = np.block([[-A, spread], [np.zeros((n, n)), A.T]])
        exponential = expm(_finite(generator * context.dt))
        integral: Matrix = exponential[n:, n:].T @ exponential[:n, n:]
        return integral


def _finite(matrix: Matrix) -> Matrix:
    if not np.isfinite(matrix).all():
        raise StepError(Status.NOT_FINITE)
    return matrix


def _along(x: Numbers, h: float, k: Numbers) -> Numbers:
    return [a + h * b for a, b in zip(x, k, strict=True)]


def _euler(f: Derivative, x: Numbers, h: float) -> Numbers:
    return _along(x, h, f(x))


def _midpoint(f: Derivative, x: Numbers, h: float) -> Numbers:
    return _along(x, h, f(_along(x, 0.5 * h, f(x))))


def _rk4(f: Derivative, x: Numbers, h: float) -> Numbers:
    """The classical Runge-Kutta method (Kutta 1901)."""
    k1 = f(x)
    k2 = f(_along(x, 0.5 * h, k1))
    k3 = f(_along(x, 0.5 * h, k2))
    k4 = f(_along(x, h, k3))
    return [a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)]


_INTEGRATORS: dict[str, Callable[[Derivative, Numbers, float], Numbers]] = {
    "euler": _euler,
    "midpoint": _midpoint,
    "rk4": _rk4,
}


def expm(A: Matrix) -> Matrix:
    """The exponential of a square matrix; of scipy, which takes long to load and is used by `exact` alone."""
    from scipy.linalg import expm as exponential

    result: Matrix = exponential(A)
    return result
