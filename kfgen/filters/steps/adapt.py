"""Noise covariances that are learnt from the innovations: R per sensor, Q (Mehra 1970; Akhlaghi et al. 2017).

They are part of the filter's state: kept full, or as factors (U above D) where the covariance is factored.
"""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.factors import udu_computed
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, assume_positive, is_zero, select, sqrt
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import Block
from kfgen.filters.covariance.kept import Kept
from kfgen.filters.covariance.noise import Additive, Computed, Factored
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.spec import constants

STEP = "step"
"""The field that keeps the last step, where Q is learnt per second."""


def _constants(model: Model, matrix: tuple[tuple[object, ...], ...]) -> list[list[Fraction]]:
    """Numbers, parameters being at the spec's values; per second where dt is given at run time."""
    t = Trace()
    given = {name: Dual(t.value(value)) for name, value in model.parameters}
    given["dt"] = Dual(t.value(1 if model.dt is None else model.dt))
    evaluator = Evaluator(t, model, given)
    values = [[evaluator.value(e).constant for e in row] for row in matrix]
    return [[Fraction(0) if v is None else v for v in row] for row in values]


class AdaptedR:
    """R of a sensor: R <- (1 - a) R + a (H P^- H^T + e e^T), e the residual after the sensor's update before."""

    def __init__(self, model: Model, sensor: SensorModel, factored: bool, epsilon: Fraction) -> None:
        assert model.options.adapt_R is not None
        self.rate = model.options.adapt_R
        self.m = sensor.dimension
        self.residual_field = f"residual_{sensor.name}"
        names = list(sensor.errors)
        start, doc = _constants(model, sensor.R), f"R of {sensor.name}, adapted"
        self.kept = Kept(f"R_{sensor.name}", start, factored, doc, names)
        self.smallest = self.m * epsilon
        self.next: Symmetric | None = None

    def blocks(self) -> list[Block]:
        doc = "z - h(x) after the last update"
        zeros = (Fraction(0),) * self.m
        return [self.kept.block(), Block(self.residual_field, self.m, doc, initial=zeros)]

    def residuals(self, t: Trace) -> list[Value]:
        return [t.element(f"kf.{self.residual_field}", i) for i in range(self.m)]

    def adapted(self, t: Trace, spread: Symmetric, used: list[Value] | None) -> Symmetric:
        """The R of this update. spread: H P^- H^T (m, m).

        Components that are not used keep their block; between them and the others (1 - a) R stays, so that the
        whole remains positive.
        """
        R, e, a = self.kept.entries(t), self.residuals(t), self.rate

        def entry(i: int, j: int) -> Value:
            rest = R[i, j] * (1 - a)
            new: Value = rest + (spread[i, j] + e[i] * e[j]) * a
            if i == j:  # a square and variances, whatever they are sums of
                assume_positive(new) if self.kept.initial[i][i] > 0 else assume_nonnegative(new)
            if used is None:
                return new
            neither = select(used[i] | used[j], rest, R[i, j])
            value: Value = select(used[i] & used[j], new, neither)
            return t.name(value, "r_adapted")

        self.next = Symmetric(self.m, entry)
        return self.next

    def store(self, t: Trace, after: Vector, used: list[Value] | None) -> None:
        """R and the residual after the update."""
        assert self.next is not None
        factors = None
        if self.kept.factored:
            dense = [[self.next[i, j] for j in range(self.m)] for i in range(self.m)]
            factors = udu_computed(dense, self.smallest)
        self.kept.store(t, self.next, factors)
        for i, e in enumerate(after):
            t.store(f"kf.{self.residual_field}", i, e if used is None else select(used[i], e, self.residuals(t)[i]))


class AdaptedQ:
    """The additive Q: Q <- (1 - b) Q + b sum of dx dx^T over the corrections of an update.

    Where dt is given at run time and Q is a constant times dt, it is kept and learnt per second: dx dx^T is divided
    by the last step, which is kept beside it.
    """

    def __init__(self, model: Model, order: list[int], factored: bool, epsilon: Fraction) -> None:
        assert model.options.adapt_Q is not None
        self.rate = model.options.adapt_Q
        given = "dt" in model.uses(*(q for row in model.Q for q in row)) and model.dt is None
        self.nominal = constants.value(model.spec.dt.nominal.tree, model.spec) if given and model.spec.dt else None
        Q = _constants(model, model.Q)
        doc = "additive process noise" + (" per second" if given else "") + ", adapted"
        names = [model.errors[i] for i in order]
        self.kept = Kept("Q", [[Q[i][j] for j in order] for i in order], factored, doc, names)
        self.smallest = len(order) * epsilon

    def blocks(self) -> list[Block]:
        step = [] if self.nominal is None else [Block(STEP, None, "the last step [s]", initial=(self.nominal,))]
        return [self.kept.block(), *step]

    def scale(self, t: Trace) -> Value | None:
        """What the corrections of an update are to be multiplied by before they are learnt from."""
        if self.nominal is None:
            return None
        step = t.field(f"kf.{STEP}")
        assume_positive(step)
        return t.name(1 / sqrt(step), "root_rate")

    def store_step(self, t: Trace, dt: Value | None) -> None:
        """Keep the length of a prediction's step."""
        if self.nominal is not None and dt is not None:
            t.store(f"kf.{STEP}", None, dt)

    def additive(self, t: Trace, added: Rows | None, dt: Value | None) -> Additive:
        """The Q of a prediction of a step dt. added: what noise densities add to it (n, n)."""
        n = self.kept.k
        times: Number = 1 if self.nominal is None or dt is None else dt
        nothing = added is None or all(is_zero(q) for row in added for q in row)
        if nothing and self.kept.factored:
            U, D = self.kept.factors(t)
            return Factored(U, [d * times for d in D], f"kf.{self.kept.field}", times)
        entries = self.kept.entries(t)
        total = [[entries[i, j] * times for j in range(n)] for i in range(n)]
        if added is not None:
            total = [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(total, added, strict=True)]
        return Computed(total, self.smallest)
