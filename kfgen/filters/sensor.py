"""A sensor's measurement model, traced: h, H, the innovation, R, decorrelated into scalar measurements."""

from __future__ import annotations

from dataclasses import dataclass

import sympy

from kfgen.filters import linalg, process
from kfgen.filters.dual import Dual, Evaluator, seeds
from kfgen.filters.linalg import Rows, Vector
from kfgen.filters.numbers import is_zero, require_nonnegative
from kfgen.ir.trace import Trace
from kfgen.model import Model
from kfgen.model.model import SensorModel


@dataclass(frozen=True)
class Innovation:
    """Scalar measurements: y (m,), rows of H (m, n) in the filter's inner order, variances (m,)."""

    y: Vector
    rows: Rows
    variances: Vector


def linearise(t: Trace, model: Model, sensor: SensorModel) -> Innovation:
    """h and H at x, z - h wrapped where it is periodic, and R + M Re M^T diagonalised."""
    used = model.uses(*model.sensor_expressions(sensor))
    x = {name: t.element("kf.x", i) for i, name in enumerate(model.states)}
    for name, value in x.items():
        if name in used:
            t.name(value, name)
    given = seeds(t, x)
    given.update(seeds(t, {w.name: t.zero for w in sensor.noises}))
    given.update(process.parameters_and_inputs(t, model))
    if "t" in used:
        given["t"] = process.time_now(t, model)
    if model.dt is not None:
        given["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, given)
    components = sensor.spec.components
    predicted = [evaluator(e) for e in sensor.h]
    y: Vector = []
    for component, p, residual, period in zip(components, predicted, sensor.residual, sensor.periods, strict=True):
        z = t.field(f"z.{component.name}")
        if residual is not None:
            evaluator.bind(sympy.Symbol(f"z_{component.name}"), z)
            evaluator.bind(sympy.Symbol(f"h_{component.name}"), p.value)
            nu = evaluator.value(residual)
        else:
            nu = z - t.name(p.value, f"h_{component.name}")
            if period is not None:
                nu = t.wrap(nu, period)
        y.append(t.name(nu, f"y_{component.name}"))
    H = [[p.gradient.get(name, t.zero) for name in model.states] for p in predicted]
    for component, row in zip(components, H, strict=True):
        for name, value in zip(model.states, row, strict=True):
            t.name(value, f"h_{component.name}_{name}")
    R = [[evaluator.value(e) for e in row] for row in sensor.R]
    m = len(y)
    if sensor.noises:
        M = [[p.gradient.get(w.name, t.zero) for w in sensor.noises] for p in predicted]
        Re = [[evaluator.value(e) for e in row] for row in sensor.noise_covariance]
        for i in range(m):
            for j in range(m):
                terms = [
                    M[i][a] * Re[a][b] * M[j][b]
                    for a in range(len(Re))
                    for b in range(len(Re))
                    if not (is_zero(M[i][a]) or is_zero(Re[a][b]) or is_zero(M[j][b]))
                ]
                for term in terms:
                    R[i][j] = R[i][j] + term
    return _decorrelated(t, y, H, R)


def _decorrelated(t: Trace, y: Vector, H: Rows, R: Rows) -> Innovation:
    """R = U D U^T; the rows of U^-1 H and the entries of U^-1 y have the independent variances D."""
    m = len(y)
    if all(is_zero(R[i][j]) for i in range(m) for j in range(m) if i != j):
        return Innovation(y, H, [R[i][i] for i in range(m)])
    t.section("decorrelate: R = U D U^T, y <- U^-1 y, H <- U^-1 H")
    U, D = linalg.udu(R)
    D = [t.value(d) for d in D]
    for d in D:
        require_nonnegative(d, "R is not positive semidefinite")
    y, H = list(y), [list(row) for row in H]
    for i in reversed(range(m)):
        for j in range(i + 1, m):
            if not is_zero(U[i][j]):
                y[i] = y[i] - U[i][j] * y[j]
                H[i] = [a if is_zero(b) else a - U[i][j] * b for a, b in zip(H[i], H[j], strict=True)]
    return Innovation(y, H, D)


def permuted(innovation: Innovation, order: list[int]) -> Innovation:
    """The same with the columns of H in another order of the states."""
    return Innovation(innovation.y, [[row[i] for i in order] for row in innovation.rows], innovation.variances)


def needs_inputs(model: Model, sensor: SensorModel) -> bool:
    """Whether an update of the sensor takes u."""
    return bool(set(model.inputs) & model.uses(*model.sensor_expressions(sensor)))
