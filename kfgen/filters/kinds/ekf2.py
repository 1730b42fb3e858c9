"""The second-order extended Kalman filter (Athans et al. 1968; Bar-Shalom, Li & Kirubarajan 2001, 10.3.3).

Second derivatives add 1/2 tr(f_i'' C) to the mean and 1/2 tr(f_i'' C f_j'' C) to the covariance, C being that of
states and noise inputs together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.gradient import Hessian
from kfgen.filters.algebra.linalg import Rows, plus, times
from kfgen.filters.algebra.numbers import Number, is_nonnegative, is_zero
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.noise import Additive, Computed, Given
from kfgen.filters.kinds.ekf import Ekf
from kfgen.filters.kinds.work import Update
from kfgen.filters.steps.compensation import with_means
from kfgen.filters.steps.process import Advance, Prior, Step
from kfgen.filters.steps.sensor import Linearised
from kfgen.ir.trace import Trace, Value

HALF = Fraction(1, 2)


class Ekf2(Ekf):
    """Hessians are symbolic; what is linear costs nothing."""

    title = "Second-order extended Kalman filter"
    derivatives = 2

    def advance(self, t: Trace, prior: Prior, step: Step) -> Advance:
        result = super().advance(t, prior, step)
        if not any(d.hessian for d in result.after):
            return result
        model = self.model
        noises = [w.name for w in model.noises]
        evaluator = Evaluator(t, model, prior.duals)
        Qw = [[evaluator.value(e) for e in row] for row in model.noise_covariance]
        terms = self._terms(t, result.after, self.form.entries(self.form.load(t)), noises, Qw)
        Given([[result.Q[i][j] for j in self.order] for i in self.order]).entries()  # tested before the rest comes in
        Q = [[q + t.value(g) for q, g in zip(a, b, strict=True)] for a, b in zip(result.Q, terms.spread, strict=True)]
        x = [a + m for a, m in zip(result.x, terms.mean, strict=True)]
        return replace(result, x=x, Q=Q, steps=with_means(result.steps, terms.mean))

    def additive(self, t: Trace, result: Advance, step: Step) -> Additive:
        if self.Q is not None or not any(d.hessian for d in result.after):
            return super().additive(t, result, step)
        Q = [[result.Q[i][j] for j in self.order] for i in self.order]
        return Computed(Q, len(Q) * self.scalar.epsilon)

    def linearise(self, u: Update) -> Linearised:
        linear = super().linearise(u)
        if not any(d.hessian for d in linear.predicted):
            return linear
        noises = [w.name for w in u.sensor.noises]
        terms = self._terms(u.t, linear.predicted, self.form.entries(u.P), noises, u.code.noise_covariance())
        predicted = [d.value + m for d, m in zip(linear.predicted, terms.mean, strict=True)]
        m = len(predicted)
        added = [[linear.added[i][j] + u.t.value(terms.spread[i][j]) for j in range(m)] for i in range(m)]
        if u.used is None and u.adapted is None and any(r.constant is None for row in linear.R for r in row):
            Given(linear.R).factors()  # tested before the rest comes in
        return replace(linear, y=u.code.residuals(u.x, predicted), added=added, computed=True)

    def _terms(self, t: Trace, values: list[Dual], P: Symmetric, noises: list[str], Qw: Rows) -> _Terms:
        """Of some values with Hessians. P: of the states in the inner order, Qw: of the noise inputs."""
        place = {name: i for i, name in enumerate(self.names)}
        t.section("second order")

        def covariance(a: str, b: str) -> Number:
            if a in place and b in place:
                return P[place[a], place[b]]
            return Qw[noises.index(a)][noises.index(b)] if a in noises and b in noises else 0

        m = len(values)
        products = [_Product(d.hessian, covariance) for d in values]
        mean = [t.value(p.trace()) * HALF for p in products]
        spread: Rows = [[t.zero] * m for _ in range(m)]
        for i in range(m):
            for j in range(i + 1):
                value = t.value(products[i].with_other(products[j])) * HALF
                if i == j and not is_nonnegative(value):  # a sum of squares but for rounding
                    value = t.function("max", value, t.zero)
                spread[i][j] = spread[j][i] = value
        return _Terms(mean, spread)


@dataclass(frozen=True)
class _Terms:
    """What is added to the mean (m,) and to the covariance (m, m)."""

    mean: list[Value]
    spread: Rows


class _Product:
    """A = f'' C, of which only the rows of variables in f'' are not zero; entries when they are asked for."""

    def __init__(self, hessian: Hessian, covariance: Callable[[str, str], Number]) -> None:
        self.hessian = hessian
        self.covariance = covariance
        self.rows: dict[str, dict[str, Value]] = {}
        for (a, b), value in hessian.items():
            self.rows.setdefault(a, {})[b] = value
            self.rows.setdefault(b, {})[a] = value
        self.made: dict[tuple[str, str], Number] = {}

    def entry(self, a: str, b: str) -> Number:
        """A_ab, a being a row of f''."""
        if (a, b) not in self.made:
            total: Number = 0
            for k, value in self.rows[a].items():
                total = plus(total, times(value, self.covariance(k, b)))
            self.made[a, b] = total
        return self.made[a, b]

    def trace(self) -> Number:
        """tr(f'' C)."""
        total: Number = 0
        for a in self.rows:
            total = plus(total, self.entry(a, a))
        return total

    def with_other(self, other: _Product) -> Number:
        """tr(A B)."""
        total: Number = 0
        for a in self.rows:
            for b in other.rows:
                x = self.entry(a, b)
                if not is_zero(x):
                    total = plus(total, times(x, other.entry(b, a)))
        return total


FILTERS = {"ekf2": Ekf2}
