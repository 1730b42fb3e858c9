"""A sensor's measurement model, traced: h, H, the residual, R; decorrelated into scalar measurements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from operator import and_

import sympy

from kfgen.filters.algebra.attitude import of_numbers
from kfgen.filters.algebra.dual import Attitude, Dual, Evaluator, seeds, state_seeds, state_values
from kfgen.filters.algebra.factors import udu, udu_computed
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero, require_nonnegative, select
from kfgen.filters.frame import guards
from kfgen.filters.steps import process
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.model.rotations import RotationModel


@dataclass(frozen=True)
class Linearised:
    """Of an innovation of m errors at some x: h and z [-] h (m,), H (m, n), the additive R (m, m), and `added` (m, m):
    what else is uncertain, M Re M^T of the noise inputs. H's columns are in the order that was asked for.

    predicted: of a quaternion the errors, without a value. computed: `added` is positive semidefinite by what it is,
    but for rounding.
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
        self.counts: list[Value] | None = None  # whether each entry of the innovation does, where a mask tells
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
        given = state_seeds(t, model, x)
        given.update(seeds(t, {w.name: t.zero for w in sensor.noises}))
        evaluator = self._evaluator(given)
        h = [evaluator(e) for e in sensor.h]
        attitudes = [predicted_attitude(evaluator, sensor, r, h) for r in sensor.rotations]
        for r, attitude in zip(sensor.rotations, attitudes, strict=True):
            h[r.first : r.first + 4] = [Dual(value) for value in attitude.q]
        y = self._residuals(evaluator, [p.value for p in h])
        predicted = [p for p, j in zip(h, sensor.space.errors_of, strict=True) if j is not None]
        for r, attitude in zip(sensor.rotations, attitudes, strict=True):
            predicted[r.first_error : r.first_error] = [Dual(t.zero, g) for g in attitude.error]
        H = [[p.gradient.get(name, t.zero) for name in model.errors] for p in predicted]
        for error, row in zip(sensor.errors, H, strict=True):
            for name, value in zip(model.errors, row, strict=True):
                t.name(value, f"h_{error}_{name}")
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
        return self._residuals(evaluator, self._predicted(evaluator), named=False)

    def predicted(self, x: list[Value]) -> list[Value]:
        """h(x)."""
        given = state_values(self.model, x)
        given.update({w.name: Dual(self.t.zero) for w in self.sensor.noises})
        return self._predicted(self._evaluator(given))

    def _predicted(self, evaluator: Evaluator) -> list[Value]:
        h = [Dual(evaluator.value(e)) for e in self.sensor.h]
        for r in self.sensor.rotations:
            h[r.first : r.first + 4] = [Dual(v) for v in predicted_attitude(evaluator, self.sensor, r, h).q]
        return [d.value for d in h]

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
        for i, _, part in sensor.space.singles:
            component, p, residual = sensor.spec.components[i], predicted[i], sensor.residual[i]
            z = t.field(f"z.{component.name}")
            if residual is not None:
                evaluator.bind(sympy.Symbol(f"z_{component.name}"), z)
                evaluator.bind(sympy.Symbol(f"h_{component.name}"), p)
                nu = evaluator.value(residual)
            else:
                nu = part.local(z, t.name(p, f"h_{component.name}") if named else p)
            y.append(t.name(nu, f"y_{component.name}" if named else f"e_{component.name}"))
        for r in sensor.rotations:
            found = r.geometry.local(self.measured(r), predicted[r.first : r.first + 4])
            y[r.first_error : r.first_error] = [
                t.name(t.value(nu), f"y_{name}" if named else f"e_{name}")
                for nu, name in zip(found, r.errors, strict=True)
            ]
        return y

    def measured(self, r: RotationModel) -> list[Value]:
        """A measured quaternion, whatever its norm is."""
        t = self.t
        z = [t.field(f"z.{part}") for part in r.parts]
        if self.counts is not None:  # what does not count may be anything
            z = [t.select(self.counts[r.first_error], a, int(k == 0)) for k, a in enumerate(z)]
        for a in z:
            t.guard(~t.finite(a), "NOT_FINITE")
        z = guards.quaternion(t, z)
        return [t.name(a, f"z_{part}") for a, part in zip(r.geometry.normalised(z), r.parts, strict=True)]

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


def predicted_attitude(evaluator: Evaluator, sensor: SensorModel, r: RotationModel, h: list[Dual]) -> Attitude:
    """The prediction of a quaternion; h: of all components."""
    own = sensor.h[r.first : r.first + 4]
    for state in evaluator.model.rotations:
        if state.geometry == r.geometry and tuple(e.name for e in own if e.is_Symbol) == state.parts:
            return evaluator.attitudes[state.name]
    return of_numbers(evaluator.trace, r.name, r.geometry, h[r.first : r.first + 4])


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


def used_errors(sensor: SensorModel, used: list[Value] | None) -> list[Value] | None:
    """Whether each error of an innovation counts, from whether each component does: a quaternion as a whole."""
    if used is None or not sensor.rotations:
        return used
    out = [used[i] for i, _, _ in sensor.space.singles]
    for r in sensor.rotations:
        whole = reduce(and_, used[r.first : r.first + 4])
        out[r.first_error : r.first_error] = [whole] * 3
    return out


def needs_inputs(model: Model, sensor: SensorModel) -> bool:
    """Whether an update of the sensor takes u."""
    return bool(set(model.inputs) & model.uses(*model.sensor_expressions(sensor)))
