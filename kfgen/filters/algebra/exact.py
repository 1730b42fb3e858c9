"""The exact discretisation of a linear continuous model: the matrix exponential and its integrals.

x' = A x + b(u, w): x[k+1] = Phi x + Gamma b with Phi = e^{A dt}, Gamma = the integral of e^{A s} ds over the step,
inputs held. A density Qc adds the integral of e^{A s} G Qc G^T e^{A^T s} ds.

With a fixed step and constant coefficients these are numbers (Van Loan 1978, to 60 digits). Otherwise Phi and
Gamma are closed forms, and the density's integral is a Gauss-Legendre sum of Phi(s_i) G Qc G^T Phi(s_i)^T: positive
weights keep it positive semidefinite whatever the rounding, where a closed form would lose all digits to
cancellation for a short step. It is exact where A is nilpotent (Phi is then a polynomial), and to 1e-12 for
|eigenvalue| dt <= 1 elsewhere.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import sympy
from sympy.integrals.quadrature import gauss_legendre

from kfgen.errors import SpecError
from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.factors import udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero
from kfgen.ir.constants import DIGITS, to_fraction, to_mpf
from kfgen.ir.trace import Trace, Value
from kfgen.model.model import Model

TIME_LIMIT = 30  # seconds for SymPy's closed form
POINTS = 6  # of the Gauss-Legendre sum where A is not nilpotent
_S = sympy.Symbol("s_step", positive=True)


@dataclass(frozen=True)
class Linear:
    """Phi, Gamma (n, n) as functions of the step `_S` and run-time names; G (n, q) of the densities."""

    model: Model
    b: tuple[Any, ...]
    Phi: Any
    Gamma: Any
    G: Any
    points: int
    A: Any

    def advance(self, t: Trace, at: Evaluator, given: dict[str, Dual], dt: Value) -> list[Dual]:
        """The step's end with its gradients."""
        at.bind(_S, dt)
        rest = [at(e) for e in self.b]
        out = []
        for i in range(len(self.b)):
            total = Dual(t.zero)
            for j, name in enumerate(self.model.states):
                for factor, term in ((self.Phi[i, j], given[name]), (self.Gamma[i, j], rest[j])):
                    if factor != 0:
                        total = total + term.scaled(at.value(factor))
            out.append(total)
        return out

    def step(self, i: int, at: Evaluator, given: dict[str, Dual]) -> Value:
        """By what state i moves, once `advance` has bound the step."""
        total: Value = at.trace.zero
        for j, name in enumerate(self.model.states):
            factor = self.Phi[i, j] - (1 if i == j else 0)
            for weight, term in ((factor, given[name].value), (self.Gamma[i, j], at.value(self.b[j]))):
                if weight != 0:
                    total = total + at.value(weight) * term
        return total

    def noise(self, t: Trace, at: Evaluator, Qc: Rows, dt: Value) -> tuple[Rows, list[tuple[Vector, Value]]]:
        """The densities over the step: a constant matrix (n, n), or columns (w, d) whose sum of d w w^T it is."""
        n = len(self.b)
        nothing: Rows = [[t.zero] * n for _ in range(n)]
        if self.G is None:
            return nothing, []
        constant = [value.constant for row in Qc for value in row]
        if dt.constant is not None and not (self.A.free_symbols | self.G.free_symbols) and None not in constant:
            q = len(Qc)
            inner = sympy.Matrix(q, q, [sympy.Rational(v.numerator, v.denominator) for v in constant if v is not None])
            exact = _van_loan(self.A, self.G * inner * self.G.T, dt.constant)
            return [[t.value(v) for v in row] for row in exact], []
        U, D = udu(Qc)
        columns = []
        nodes, weights = gauss_legendre(self.points, DIGITS)
        for node, weight in zip(nodes, weights, strict=True):
            spot = (1 + _rational(node)) / 2
            moved = (self.Phi.subs(_S, spot * _S) * self.G).applyfunc(sympy.expand)
            share = dt * (_fraction(weight) / 2)
            for k in range(self.G.shape[1]):
                w = [at.value(e) for e in moved[:, k]]
                for j in range(k):  # Qc = U D U^T mixes the earlier ones in
                    if not is_zero(U[j][k]):
                        w = [a + at.value(e) * U[j][k] for a, e in zip(w, moved[:, j], strict=True)]
                if not is_zero(D[k]):
                    columns.append((w, D[k] * share))
        return nothing, columns


def _fraction(value: Any) -> Fraction:
    return to_fraction(mpmath.mpf(value._mpf_) if hasattr(value, "_mpf_") else mpmath.mpf(value))


def _rational(value: Any) -> Any:
    exact = _fraction(value)
    return sympy.Rational(exact.numerator, exact.denominator)


def _van_loan(A: Any, Qc: Any, dt: Fraction) -> list[list[Fraction]]:
    """The integral of e^{A s} Qc e^{A^T s} ds from one exponential of twice the size."""
    n = A.shape[0]
    with mpmath.workdps(DIGITS + 20):
        block = mpmath.zeros(2 * n)
        for i in range(n):
            for j in range(n):
                a = mpmath.mpf(sympy.N(A[i, j], DIGITS + 20)._mpf_) if A[i, j] != 0 else mpmath.mpf(0)
                q = mpmath.mpf(sympy.N(Qc[i, j], DIGITS + 20)._mpf_) if Qc[i, j] != 0 else mpmath.mpf(0)
                block[i, j], block[n + j, n + i], block[i, n + j] = -a, a, q
        big = mpmath.expm(block * to_mpf(dt), method="taylor")
        phi = big[n : 2 * n, n : 2 * n].T
        Q = phi * big[0:n, n : 2 * n]
        return [[to_fraction((Q[i, j] + Q[j, i]) / 2) for j in range(n)] for i in range(n)]


def discretise(model: Model) -> Linear:
    """The closed forms; SpecError where f is not linear in the states or none is found."""
    for r, turn in zip(model.rotations, model.turns, strict=True):
        if any(e != 0 for e in turn or ()):
            raise SpecError.at(
                model.spec.dynamics.f[r.errors[0]].place,
                f"integrator exact needs a linear f, and the attitude {r.name} that turns is none",
                "use rk4; or euler, which turns it exactly where its rate is constant over the step",
            )
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
    noises = [model.symbols[w.name] for w in model.noises if w.density]
    G = sympy.Matrix(n, len(noises), lambda i, c: b[i].diff(noises[c])) if noises else None
    b = [e.subs(dict.fromkeys(noises, 0)) for e in b]
    multiplied = sorted(s.name for s in A.free_symbols if s in {model.symbols[w.name] for w in model.noises})
    if multiplied:
        raise SpecError.at(
            model.spec.dynamics.place,
            f"integrator exact needs noises that are added, and {', '.join(multiplied)} multiplies a state",
            "use rk4",
        )
    Phi, Gamma, power = sympy.zeros(n, n), sympy.zeros(n, n), sympy.eye(n)
    for k in range(n + 1):
        Phi += power * _S**k / sympy.factorial(k)
        Gamma += power * _S ** (k + 1) / sympy.factorial(k + 1)
        power = (power * A).applyfunc(sympy.expand)
        if power.is_zero_matrix:  # nilpotent: the series ends, and k + 1 points integrate degree 2 k exactly
            return Linear(model, tuple(b), Phi, Gamma, G, k + 1, A)
    if model.dt is not None and not A.free_symbols:
        Phi, Gamma = _numbers(A, model.dt)
        return Linear(model, tuple(b), Phi, Gamma, G, POINTS, A)
    closed = _in_time(A)
    if closed is None:
        raise SpecError.at(
            model.spec.dynamics.place,
            "integrator exact found no closed form of the matrix exponential",
            "use rk4 with substeps, or make the coefficients constants",
        )
    return Linear(model, tuple(b), *closed, G, POINTS, A)


def _numbers(A: Any, dt: Fraction) -> tuple[Any, Any]:
    """Phi and Gamma of a constant A and a fixed step: one exponential of [[A, I], [0, 0]]."""
    n = A.shape[0]
    with mpmath.workdps(DIGITS + 20):
        block = mpmath.zeros(2 * n)
        for i in range(n):
            block[i, n + i] = mpmath.mpf(1)
            for j in range(n):
                if A[i, j] != 0:
                    block[i, j] = mpmath.mpf(sympy.N(A[i, j], DIGITS + 20)._mpf_)
        big = mpmath.expm(block * to_mpf(dt), method="taylor")
        Phi = sympy.Matrix(n, n, lambda i, j: _rational_of(big[i, j]))
        Gamma = sympy.Matrix(n, n, lambda i, j: _rational_of(big[i, n + j]))
    return Phi, Gamma


def _rational_of(value: Any) -> Any:
    exact = to_fraction(value)
    return sympy.Rational(exact.numerator, exact.denominator)


def _in_time(A: Any) -> tuple[Any, Any] | None:
    """SymPy's general closed form, in a process of its own that ends after TIME_LIMIT."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "kfgen.filters.algebra.exact"], input=pickle.dumps(A), capture_output=True,
            timeout=TIME_LIMIT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None
    if done.returncode != 0:
        return None
    result: tuple[Any, Any] | None = pickle.loads(done.stdout)
    return result


def _general(A: Any) -> tuple[Any, Any] | None:
    """By Jordan form; complex pairs become sines and cosines."""
    s = sympy.Symbol("s_inner", positive=True)
    real = {symbol: sympy.Symbol(symbol.name, real=True) for symbol in A.free_symbols}
    A = A.subs(real)

    def tidy(e: Any) -> Any:
        return sympy.simplify(sympy.expand_complex(e)) if e.has(sympy.I) else sympy.simplify(e)

    Phi = (A * _S).exp().applyfunc(tidy)
    Gamma = Phi.applyfunc(lambda e: tidy(sympy.integrate(e.subs(_S, s), (s, 0, _S))))
    bad = (sympy.I, sympy.Integral, sympy.Piecewise, sympy.re, sympy.im, sympy.arg, sympy.Abs, sympy.sign)
    if any(m.has(*bad) for m in (Phi, Gamma)):
        return None
    back = {value: key for key, value in real.items()}
    return Phi.subs(back), Gamma.subs(back)


if __name__ == "__main__":
    sys.stdout.buffer.write(pickle.dumps(_general(pickle.loads(sys.stdin.buffer.read()))))
