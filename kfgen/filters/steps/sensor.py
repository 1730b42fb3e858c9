"""A sensor's measurement model, traced: h, H, the residual, R; decorrelated into scalar measurements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import sympy

from kfgen.filters.algebra.dual import Dual, Evaluator, seeds
from kfgen.filters.algebra.factors import udu, udu_computed
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero, require_nonnegative, select
from kfgen.filters.steps import process
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel


@dataclass(frozen=True)
class Linearised:
    """Of m components at some x: h and z - h (m,), H (m, n), the additive R (m, m), and `added` (m, m): what else
    is uncertain, M Re M^T of the noise inputs. H's columns are in the order that was asked for.

    computed: `added` is positive semidefinite by what it is, but for rounding.
    """

    predicted: list[Dual]
    y: Vector
    H: Rows
    R: Rows
    added: Rows
    computed: bool = False


@dataclass(frozen=True)
class Innovation:
    """Scalar measurements: y (m,), rows of H (m, n) in the filter's inner order, variances (m,).

    used: whether each component counts, where a mask tells.
    """

    y: Vector
    rows: Rows
    variances: Vector
    used: list[Value] | None = None


class SensorCode:
    """Evaluates the model of a sensor in a trace, at kf.x or at another state.

    derivatives: 2 has the evaluator carry second ones too. skipped: noise inputs that are accounted for otherwise.
    """

    def __init__(self, t: Trace, model: Model, sensor: SensorModel, order: list[int], derivatives: int = 1,
                 skipped: tuple[str, ...] = ()) -> None:  # fmt: skip
        self.skipped = skipped
        self.t = t
        self.model = model
        self.sensor = sensor
        self.order = order
        self.derivatives = derivatives
        self.used = model.uses(*model.sensor_expressions(sensor))

    def prior(self) -> list[Value]:
        """kf.x, in the spec's order."""
        x = [self.t.element("kf.x", i) for i in range(len(self.model.states))]
        for name, value in zip(self.model.states, x, strict=True):
            if name in self.used:
                self.t.name(value, name)
        return x

    def linearise(self, x: list[Value]) -> Linearised:
        """h, H and R at x, z - h wrapped where it is periodic."""
        t, model, sensor = self.t, self.model, self.sensor
        given = seeds(t, dict(zip(model.states, x, strict=True)))
        given.update(seeds(t, {w.name: t.zero for w in sensor.noises}))
        evaluator = self._evaluator(given)
        predicted = [evaluator(e) for e in sensor.h]
        y = self._residuals(evaluator, [p.value for p in predicted])
        H = [[p.gradient.get(name, t.zero) for name in model.states] for p in predicted]
        for component, row in zip(sensor.spec.components, H, strict=True):
            for name, value in zip(model.states, row, strict=True):
                t.name(value, f"h_{component.name}_{name}")
        R = [[evaluator.value(e) for e in row] for row in sensor.R]
        added = self._noise(evaluator, predicted)
        return Linearised(predicted, y, [[row[i] for i in self.order] for row in H], R, added)

    def noise_covariance(self, evaluator: Evaluator | None = None) -> Rows:
        """Of the noise inputs of the sensor; by default at the prior."""
        if evaluator is None:
            x = zip(self.model.states, self.prior(), strict=True)
            evaluator = self._evaluator({name: Dual(value) for name, value in x})
        return [[evaluator.value(e) for e in row] for row in self.sensor.noise_covariance]

    def residual(self, x: list[Value]) -> Vector:
        """z - h(x), wrapped where it is periodic, or the components' own residuals."""
        t = self.t
        given = {name: Dual(value) for name, value in zip(self.model.states, x, strict=True)}
        given.update({w.name: Dual(t.zero) for w in self.sensor.noises})
        evaluator = self._evaluator(given)
        return self._residuals(evaluator, [evaluator.value(e) for e in self.sensor.h], named=False)

    def residuals(self, x: list[Value], predicted: list[Value], named: bool = True) -> Vector:
        """The same for a prediction (m,) that is not h(x) alone."""
        evaluator = self._evaluator({name: Dual(value) for name, value in zip(self.model.states, x, strict=True)})
        return self._residuals(evaluator, predicted, named)

    def _evaluator(self, given: dict[str, Dual]) -> Evaluator:
        t, model = self.t, self.model
        given.update(process.parameters_and_inputs(t, model, sensor=self.sensor))
        if "t" in self.used:
            given["t"] = process.time_now(t, model)
        if model.dt is not None:
            given["dt"] = Dual(t.value(model.dt))
        return Evaluator(t, model, given, self.derivatives)

    def _residuals(self, evaluator: Evaluator, predicted: list[Value], named: bool = True) -> Vector:
        t, sensor = self.t, self.sensor
        y: Vector = []
        for component, p, residual, part in zip(
            sensor.spec.components, predicted, sensor.residual, sensor.parts, strict=True
        ):
            z = t.field(f"z.{component.name}")
            if residual is not None:
                evaluator.bind(sympy.Symbol(f"z_{component.name}"), z)
                evaluator.bind(sympy.Symbol(f"h_{component.name}"), p)
                nu = evaluator.value(residual)
            else:
                nu = part.local(z, t.name(p, f"h_{component.name}") if named else p)
            y.append(t.name(nu, f"y_{component.name}" if named else f"e_{component.name}"))
        return y

    def _noise(self, evaluator: Evaluator, predicted: list[Dual]) -> Rows:
        """M Re M^T, M = dh/de."""
        t, sensor = self.t, self.sensor
        m = len(predicted)
        added: Rows = [[t.zero] * m for _ in range(m)]
        if not sensor.noises:
            return added
        M = [
            [t.zero if w.name in self.skipped else p.gradient.get(w.name, t.zero) for w in sensor.noises]
            for p in predicted
        ]
        Re = self.noise_covariance(evaluator)
        for i in range(m):
            for j in range(m):
                for a in range(len(Re)):
                    for b in range(len(Re)):
                        if not (is_zero(M[i][a]) or is_zero(Re[a][b]) or is_zero(M[j][b])):
                            added[i][j] = added[i][j] + M[i][a] * Re[a][b] * M[j][b]
        return added


def total(linear: Linearised) -> Rows:
    """R and what else is uncertain."""
    return [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(linear.R, linear.added, strict=True)]


def masked(t: Trace, linear: Linearised, R: Rows, used: list[Value]) -> tuple[Linearised, Rows]:
    """Components that are not used measure nothing, with a variance of 1: they change nothing."""
    m = len(used)

    def variance(i: int, j: int) -> Value:
        if i == j:
            own: Value = select(used[i], R[i][i], t.one)
            return own
        return t.zero if is_zero(R[i][j]) else select(used[i] & used[j], R[i][j], t.zero)

    y = [t.name(select(u, y, t.zero), "y") for u, y in zip(used, linear.y, strict=True)]
    H = [[h if is_zero(h) else select(u, h, t.zero) for h in row] for u, row in zip(used, linear.H, strict=True)]
    return replace(linear, y=y, H=H), [[variance(i, j) for j in range(m)] for i in range(m)]


def decorrelated(
    t: Trace, linear: Linearised, R: Rows, used: list[Value] | None = None, smallest: Fraction | None = None
) -> Innovation:
    """R = U D U^T; the rows of U^-1 H and the entries of U^-1 y have the independent variances D.

    smallest: R was computed, and its pivots are not below this part of its diagonal.
    """
    y, H = linear.y, linear.H
    m = len(y)
    if all(is_zero(R[i][j]) for i in range(m) for j in range(m) if i != j):
        return Innovation(y, H, [R[i][i] for i in range(m)], used)
    t.section("decorrelate: R = U D U^T, y <- U^-1 y, H <- U^-1 H")
    U, D = udu(R) if smallest is None else udu_computed(R, smallest)
    D = [t.value(d) for d in D]
    for d in D:
        require_nonnegative(d, "R is not positive semidefinite")
    y, H = list(y), [list(row) for row in H]
    for i in reversed(range(m)):
        for j in range(i + 1, m):
            if not is_zero(U[i][j]):
                y[i] = y[i] - U[i][j] * y[j]
                H[i] = [a if is_zero(b) else a - U[i][j] * b for a, b in zip(H[i], H[j], strict=True)]
    return Innovation(y, H, D, used)


def needs_inputs(model: Model, sensor: SensorModel) -> bool:
    """Whether an update of the sensor takes u."""
    return bool(set(model.inputs) & model.uses(*model.sensor_expressions(sensor)))
