"""The Kalman filter and the extended Kalman filter (Bar-Shalom, Li & Kirubarajan 2001, ch. 5 and 10).

predict: F, G at the prior x; x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T.
update: scalar measurements one after another, decorrelated where R is full; the innovation of each is corrected
by what the earlier ones have already moved, so that the result is that of the whole vector.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from kfgen.filters import linalg, process
from kfgen.filters.base import DT, INPUTS, KF, FilterCode, sensor_argument
from kfgen.filters.numbers import assume_nonnegative, is_nonnegative, is_positive, is_zero
from kfgen.filters.sensor import Innovation, linearise, needs_inputs, permuted
from kfgen.filters.state import StateCode
from kfgen.ir.program import Argument, Function, Store
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import chi2_quantile

# Measured with gcc 12 on a Cortex-M4F: its schedulers lengthen live ranges, and what no longer fits the registers
# costs two instructions each time.
LONG_FUNCTIONS = (
    "Long straight-line functions: gcc keeps more of them in registers with the flags",
    "  -O2 -fno-schedule-insns -fno-schedule-insns2 -flive-range-shrinkage -fno-tree-sink -frename-registers",
)

_TITLES = {"kf": "Kalman filter", "ekf": "Extended Kalman filter"}


class Ekf:
    """Emits a kf or an ekf over any layout."""

    def __init__(self, model: Model, layout: Any, order: list[int], epsilon: Fraction) -> None:
        self.model = model
        self.layout = layout
        self.order = order
        self.epsilon = epsilon
        self.names = [model.states[i] for i in order]
        self.state = StateCode(model, layout, order, epsilon)

    def code(self, taken: frozenset[str]) -> FilterCode:
        """The complete filter. taken: names that locals must not have."""
        model = self.model
        functions = [self.state.init(taken), self.predict(taken)]
        functions += [self.update(sensor, taken) for sensor in model.sensors]
        functions += [
            self.state.set_state(taken),
            self.state.set_covariance(taken),
            self.state.get_covariance(taken),
        ]
        identity = self.order == list(range(len(self.order)))
        spec = model.spec.filter
        layout = {"ud": "U D U^T", "full": "full"}[spec.covariance]
        return FilterCode(
            model=model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(self.order),
            description=f"{_TITLES[spec.type]}, {layout} covariance, {spec.update} update",
            notes=LONG_FUNCTIONS if len(self.order) >= 8 else (),
            constants={} if identity else {"order": tuple(self.order)},
        )

    # predict -----------------------------------------------------------------------------------------

    def predict(self, taken: frozenset[str]) -> Function:
        """x <- f(x, u, 0), P <- F P F^T + Q + G Qw G^T."""
        model, t = self.model, Trace()
        arguments: list[Argument] = [KF]
        if model.inputs:
            arguments.append(INPUTS)
            t.section("arguments")
            inputs = [t.field(f"u.{name}") for name in model.inputs]
            t.guard(~t.finite(sum(inputs[1:], inputs[0])), "NOT_FINITE")
        if model.dt is None and model.spec.dt is not None:
            arguments.append(DT)
        step = process.step_length(t, model)
        prior = process.given(t, model, step)
        t.section("model")
        result = process.advance(t, model, prior, step)
        order = self.order
        F = [[result.F[i][j] for j in order] for i in order]
        Q = [[result.Q[i][j] for j in order] for i in order]
        noise = [([w[i] for i in order], d) for w, d in result.noise]
        for i, row in zip(order, F, strict=True):
            for j, value in zip(order, row, strict=True):
                t.name(value, f"f_{model.states[i]}_{model.states[j]}")
        P = self.layout.predict(t, self.layout.load(t), F, Q, noise)
        x = [t.name(value, f"{name}_next") for value, name in zip(result.x, model.states, strict=True)]
        self._finish(
            t,
            x,
            P,
            [],
            after_predict=True,
            x_changed=[v.node is not p.node for v, p in zip(x, prior.x, strict=True)],
        )
        process.store_time(t, model, step)
        body = schedule(t, taken)
        length = (
            "one step"
            if model.spec.dt is None
            else f"one step of {_decimal(model.dt)} s"
            if model.dt is not None
            else "a step of dt"
        )
        return Function("predict", arguments, body, f"Advance the estimate by {length}.")

    def _finish(self, t: Trace, x: list[Value], P: Any, evidence: list[Value], after_predict: bool,
                x_changed: list[bool]) -> None:  # fmt: skip
        """Limits, wrapping, guards and stores, in that order."""
        model = self.model
        floors = [model.floors[i] for i in self.order]
        ceilings = [model.ceilings[i] for i in self.order]
        if any(v is not None for v in [*floors, *ceilings]):
            t.section("limits of the variances")
            P = self.layout.limit(t, P, floors, ceilings)
        x = self.state.confined(t, x)
        t.section("guards")
        changed = [v for v, c in zip(x, x_changed, strict=True) if c]
        checked = evidence + changed + self.layout.evidence(P, after_predict)
        checked = [v for v in checked if v.constant is None]
        if checked:
            t.guard(~t.finite(sum(checked[1:], checked[0])), "NOT_FINITE")
        self._pending(t)
        t.section("store")
        for i, (value, c) in enumerate(zip(x, x_changed, strict=True)):
            if c:
                t.store("kf.x", i, value)
        self.layout.store(t, P, self.names, after_predict)

    def _pending(self, t: Trace) -> None:
        for condition, status, why in t.__dict__.pop("pending", []):
            t.guard(condition, status, why)

    # update ------------------------------------------------------------------------------------------

    def update(self, sensor: SensorModel, taken: frozenset[str]) -> Function:
        """The update with the whole vector z of a sensor."""
        model, t = self.model, Trace()
        arguments: list[Argument] = [KF, sensor_argument(sensor.name)]
        if needs_inputs(model, sensor):
            arguments.append(INPUTS)
            inputs = [t.field(f"u.{name}") for name in model.inputs]
            t.guard(~t.finite(sum(inputs[1:], inputs[0])), "NOT_FINITE")
        self.state.initialize(t, sensor)
        t.section("innovation")
        innovation = permuted(linearise(t, model, sensor), self.order)
        gate = None if sensor.gate is None else t.value(chi2_quantile(sensor.gate, len(sensor.h)))
        x, P, nis = self._sequence(t, sensor, innovation, gate)
        self._finish(t, x, P, [nis], after_predict=False, x_changed=[True] * len(x))
        t.store("kf.nis", None, nis)
        return Function(
            f"update_{sensor.name}",
            arguments,
            schedule(t, taken),
            f"Take a measurement of {sensor.name} into account.",
        )

    def _sequence(self, t: Trace, sensor: SensorModel, innovation: Innovation, gate: Value | None
                  ) -> tuple[list[Value], Any, Value]:  # fmt: skip
        """All components; returns x (spec's order), P and nis."""
        order, layout = self.order, self.layout
        P = layout.load(t)
        prior = [t.element("kf.x", i) for i in order]
        moved: list[Any] = [0] * len(order)  # x - prior
        rows, variances, y = innovation.rows, innovation.variances, innovation.y
        names = [c.name for c in sensor.spec.components]
        nis: Any = 0
        tests: list[Value] = []
        uncertain: list[Value] = [v for v in y if gate is not None]
        for r in variances:
            if not is_nonnegative(r):
                t.guard(r < 0, "NOT_POSITIVE", "a measurement variance is negative")
                assume_nonnegative(r)
        group = getattr(layout, "group", 1)
        for first in range(0, len(rows), group):
            part = range(first, min(first + group, len(rows)))
            t.section(
                "gain and covariance: " + ", ".join(names[c] for c in part) if len(rows) > 1 else "gain and covariance"
            )
            low = [
                getattr(layout, "tolerance", lambda P, h: 0)(P, rows[c]) if not is_positive(variances[c]) else 0
                for c in part
            ]
            P, gains, s = layout.update(t, P, [rows[c] for c in part], [variances[c] for c in part])
            for c, K, variance, tolerance in zip(part, gains, s, low, strict=True):
                t.name(variance, f"s_{names[c]}")
                correction = linalg.dot(rows[c], moved)
                nu = y[c] if is_zero(correction) else y[c] - correction
                if not is_zero(correction):
                    t.name(nu, f"nu_{names[c]}")
                moved = [
                    m if is_zero(k) else k * nu if is_zero(m) else m + k * nu for m, k in zip(moved, K, strict=True)
                ]
                square = nu * nu / variance
                if is_positive(variances[c]):
                    tests.append(~(variance > 0))
                else:
                    square = t.select(variance > 0, square, 0)
                    tests.append(variance < -tolerance)
                    uncertain += [y[c], variance]
                nis = square if is_zero(nis) else nis + square
        t.section("state and innovation squared")
        nis = t.name(nis, "nis")
        x = [p if is_zero(m) else p + m for p, m in zip(prior, moved, strict=True)]
        by_state: list[Any] = [None] * len(order)
        for place, value in zip(order, x, strict=True):
            by_state[place] = t.name(value, f"{self.model.states[place]}_next")
        if uncertain:  # what nis need not show: z where a component may be skipped, or its gate closed
            t.guard(~t.finite(sum(uncertain[1:], uncertain[0])), "NOT_FINITE")
        if gate is not None:
            self._guard_positive(t, tests)
            t.section("gate")
            t.guard(nis > gate, "GATED", before=[Store("kf.nis", None, nis.node)])
        else:
            t.__dict__["pending"] = [(test, "NOT_POSITIVE", "") for test in _joined(tests)]
        return by_state, P, nis

    def _guard_positive(self, t: Trace, tests: list[Value]) -> None:
        for test in _joined(tests):
            t.guard(test, "NOT_POSITIVE")


def _joined(tests: list[Value]) -> list[Value]:
    """One condition of many."""
    live = [test for test in tests if test.constant != 0]
    if not live:
        return []
    total = live[0]
    for test in live[1:]:
        total = total | test
    return [total]


def _decimal(value: Fraction | None) -> str:
    return f"{float(value):.6g}" if value is not None else "dt"
