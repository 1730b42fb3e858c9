"""The exact discretisation of a linear continuous model: closed forms of the matrix exponential and its integrals.

x' = A x + b(u, w): x[k+1] = Phi x + Gamma b with Phi = e^{A dt}, Gamma = the integral of e^{A s} ds over the step,
inputs held. A density Qc adds the integral of e^{A s} G Qc G^T e^{A^T s} ds (Van Loan 1978 gives the same numerically).
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import sympy

from kfgen.errors import SpecError
from kfgen.filters.dual import Dual, Evaluator
from kfgen.filters.linalg import Rows
from kfgen.ir.trace import Trace, Value
from kfgen.model.model import Model

TIME_LIMIT = 30  # seconds for SymPy's closed form
_S = sympy.Symbol("s_step", positive=True)


@dataclass(frozen=True)
class Linear:
    """Phi, Gamma (n, n) and the density's covariance (n, n) as functions of the step `_S` and run-time names."""

    model: Model
    A: Any
    b: tuple[Any, ...]
    Phi: Any
    Gamma: Any
    Q: Any

    def advance(self, t: Trace, at: Evaluator, given: dict[str, Dual], dt: Value) -> tuple[list[Dual], Rows]:
        """The step's end with its gradients, and the covariance of the densities."""
        names = self.model.states
        at.bind(_S, dt)
        rest = [at(e) for e in self.b]
        out = []
        for i in range(len(names)):
            total = Dual(t.zero)
            for j, name in enumerate(names):
                for factor, term in ((self.Phi[i, j], given[name]), (self.Gamma[i, j], rest[j])):
                    if factor != 0:
                        total = total + term.scaled(at.value(factor))
            out.append(total)
        n = len(names)
        return out, [[at.value(self.Q[i, j]) for j in range(n)] for i in range(n)]


def discretise(model: Model) -> Linear:
    """The closed forms; SpecError where f is not linear in the states or none is found."""
    definitions = {model.symbols[name]: e for name, e in model.definitions}

    def flat(e: Any) -> Any:
        for symbol, value in reversed(definitions.items()):
            e = e.subs(symbol, value)
        return e

    states = [model.symbols[name] for name in model.states]
    f = [flat(e) for e in model.f]
    n = len(states)
    A = sympy.Matrix(n, n, lambda i, j: sympy.expand(f[i]).diff(states[j]))
    for i in range(n):
        guilty = sorted(s.name for s in A[i, :].free_symbols if s in states)
        if guilty:
            raise SpecError.at(
                model.f_places[i],
                f"integrator exact needs a linear f, and this is not linear in {', '.join(guilty)}",
                "use rk4",
            )
    b = [sympy.expand(f[i] - sum((A[i, j] * states[j] for j in range(n)), sympy.S.Zero)) for i in range(n)]
    noises = [(k, model.symbols[w.name]) for k, w in enumerate(model.noises) if w.density]
    G = sympy.Matrix(n, len(noises), lambda i, c: b[i].diff(noises[c][1])) if noises else None
    b = [e.subs({w: 0 for _, w in noises}) for e in b]
    Qc = sympy.zeros(n, n)
    if G is not None:
        inner = sympy.Matrix(len(noises), len(noises),
                             lambda i, j: model.noise_covariance[noises[i][0]][noises[j][0]])  # fmt: skip
        Qc = G * inner * G.T
    closed = _closed_forms(A, Qc)
    if closed is None:
        raise SpecError.at(
            model.spec.dynamics.place,
            "integrator exact found no closed form of the matrix exponential",
            "use rk4 with substeps, or make the coefficients constants",
        )
    return Linear(model, A, tuple(b), *closed)


def _closed_forms(A: Any, Qc: Any) -> tuple[Any, Any, Any] | None:
    """Phi, Gamma, Q for the step _S."""
    n = A.shape[0]
    power, Phi, Gamma = sympy.eye(n), sympy.zeros(n, n), sympy.zeros(n, n)
    for k in range(n + 1):
        Phi += power * _S**k / sympy.factorial(k)
        Gamma += power * _S ** (k + 1) / sympy.factorial(k + 1)
        power = (power * A).applyfunc(sympy.expand)
        if power.is_zero_matrix:  # nilpotent: the series ends
            return Phi, Gamma, _integral(Phi, Qc)
    return _in_time(A, Qc)


def _integral(Phi: Any, Qc: Any) -> Any:
    integrand = (Phi * Qc * Phi.T).applyfunc(sympy.expand)
    s = sympy.Symbol("s_inner", positive=True)
    return integrand.applyfunc(lambda e: sympy.integrate(e.subs(_S, s), (s, 0, _S)) if e != 0 else e)


def _in_time(A: Any, Qc: Any) -> tuple[Any, Any, Any] | None:
    """SymPy's general closed form, in a process of its own that ends after TIME_LIMIT."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "kfgen.filters.exact"], input=pickle.dumps((A, Qc)), capture_output=True,
            timeout=TIME_LIMIT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None
    if done.returncode != 0:
        return None
    result: tuple[Any, Any, Any] | None = pickle.loads(done.stdout)
    return result


def _general(A: Any, Qc: Any) -> tuple[Any, Any, Any] | None:
    """By Jordan form; complex pairs become sines and cosines."""
    s = sympy.Symbol("s_inner", positive=True)
    real = {symbol: sympy.Symbol(symbol.name, real=True) for symbol in A.free_symbols | Qc.free_symbols}
    A, Qc = A.subs(real), Qc.subs(real)

    def tidy(e: Any) -> Any:
        e = sympy.simplify(sympy.expand_complex(e)) if e.has(sympy.I) else sympy.simplify(e)
        return e

    Phi = (A * _S).exp().applyfunc(tidy)
    Gamma = Phi.applyfunc(lambda e: tidy(sympy.integrate(e.subs(_S, s), (s, 0, _S))))
    Q = _integral(Phi, Qc).applyfunc(tidy)
    bad = (sympy.I, sympy.Integral, sympy.Piecewise, sympy.re, sympy.im, sympy.arg, sympy.Abs, sympy.sign)
    if any(m.has(*bad) for m in (Phi, Gamma, Q)):
        return None
    back = {value: key for key, value in real.items()}
    return Phi.subs(back), Gamma.subs(back), Q.subs(back)


if __name__ == "__main__":
    sys.stdout.buffer.write(pickle.dumps(_general(*pickle.loads(sys.stdin.buffer.read()))))
