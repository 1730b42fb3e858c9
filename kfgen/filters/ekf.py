"""The Kalman filter and the extended Kalman filter (Bar-Shalom, Li & Kirubarajan 2001, ch. 5 and 10).

predict: F, G at the prior x; x <- f(x, u, 0); P <- F P F^T + Q + G Qw G^T.
update: scalar measurements one after another, decorrelated where R is full; the innovation of each is corrected
by what the earlier ones have already moved, so that the result is that of the whole vector.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import or_
from typing import Any

from kfgen.filters import linalg, process
from kfgen.filters.base import DT, INPUTS, KF, FilterCode, sensor_argument
from kfgen.filters.layout import Covariance, Layout
from kfgen.filters.numbers import is_positive, is_zero, require_nonnegative
from kfgen.filters.sensor import Innovation, linearise, needs_inputs, permuted
from kfgen.filters.state import StateCode, counts_gated
from kfgen.ir.program import Argument, Function, Store
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import chi2_quantile, log_two_pi
from kfgen.scalars import Scalar

# Measured with gcc 12 on a Cortex-M4F: its schedulers lengthen live ranges, and what no longer fits the registers
# costs two instructions each time.
LONG_FUNCTIONS = (
    "Recommended with gcc, for these long functions without branches:",
    "  -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers",
)

_TITLES = {"kf": "Kalman filter", "ekf": "Extended Kalman filter"}


class Ekf:
    """Emits a kf or an ekf over any layout."""

    def __init__(self, model: Model, layout: Layout, order: list[int], scalar: Scalar) -> None:
        self.model = model
        self.layout = layout
        self.order = order
        self.scalar = scalar
        self.names = [model.states[i] for i in order]
        self.state = StateCode(model, layout, order, scalar.epsilon)

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
        return FilterCode(
            model=model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(self.order),
            description=f"{_TITLES[spec.type]}, {self.layout.title} covariance, {spec.update} update",
            notes=LONG_FUNCTIONS if len(self.order) >= 8 else (),
            constants={} if identity else {"order": tuple(self.order)},
        )

    # predict -----------------------------------------------------------------------------------------

    def predict(self, taken: frozenset[str]) -> Function:
        """x <- f(x, u, 0), P <- F P F^T + Q + G Qw G^T."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments: list[Argument] = [KF]
        if model.inputs:
            arguments.append(INPUTS)
            t.section("arguments")
            self._guard_inputs(t)
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
        for row_name, row in zip(self.names, F, strict=True):
            for name, value in zip(self.names, row, strict=True):
                t.name(value, f"f_{row_name}_{name}")
        P = self.layout.predict(t, self.layout.load(t), F, Q, noise)
        x = [t.name(value, f"{name}_next") for value, name in zip(result.x, model.states, strict=True)]
        evidence = self._unconfined(x) + self.layout.evidence(P, after_predict=True)
        P = self._limited(t, P)
        x = self.state.confined(t, x)
        moved = {i for i, (value, before) in enumerate(zip(x, prior.x, strict=True)) if value.node is not before.node}
        t.section("guards")
        self._guard_doubts(t, [*result.x, *(v for rows in (F, Q) for row in rows for v in row), *(d for _, d in noise)])
        self._guard_finite(t, [x[i] for i in sorted(moved)] + evidence)
        self._store(t, x, moved, P, after_predict=True)
        process.store_time(t, model, step)
        length = "a step of dt" if model.dt is None else f"one step of {float(model.dt):.6g} s"
        if model.spec.dt is None:
            length = "one step"
        return Function(
            "predict", arguments, schedule(t, taken | {a.name for a in arguments}), f"Advance the estimate by {length}."
        )

    # update ------------------------------------------------------------------------------------------

    def update(self, sensor: SensorModel, taken: frozenset[str]) -> Function:
        """The update with the whole vector z of a sensor."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments: list[Argument] = [KF, sensor_argument(sensor.name)]
        if needs_inputs(model, sensor):
            arguments.append(INPUTS)
            self._guard_inputs(t)
        self.state.initialize(t, sensor)
        t.section("innovation")
        innovation = permuted(linearise(t, model, sensor), self.order)
        for r in innovation.variances:
            require_nonnegative(r, "a measurement variance is negative")
        result = self._sequence(t, sensor, innovation)
        evidence = self._unconfined(result.x) + self.layout.evidence(result.P, after_predict=False)
        P = self._limited(t, result.P)
        x = self.state.confined(t, result.x)
        t.section("guards")
        model_values = [v for row in innovation.rows for v in row if isinstance(v, Value)]
        self._guard_doubts(t, [*innovation.y, *innovation.variances, *model_values])
        if sensor.gate is None:
            # nis shows whether z is finite, but for components that may have been skipped
            skippable = [v for v, r in zip(innovation.y, innovation.variances, strict=True) if not is_positive(r)]
            self._guard_finite(t, [*skippable, *x, result.nis, *evidence])
            self._guard_positive(t, result.failures)
        else:
            # A far outlier may overflow nis and is gated all the same: z is tested by itself, and first.
            self._guard_finite(t, [*innovation.y, *result.s])
            self._guard_positive(t, result.failures)
            self._gate(t, sensor, result.nis)
            self._guard_finite(t, [result.nis, *x, *evidence])
        self._store(t, x, set(range(len(x))), P, after_predict=False)
        if counts_gated(model, sensor):
            t.store(f"kf.gate_count_{sensor.name}", None, t.wrapped(t.pool.integer(0)))
        t.store("kf.nis", None, result.nis)
        if model.spec.code.log_likelihood:
            t.store("kf.log_likelihood", None, result.log_likelihood)
        what = f"Take a measurement of {sensor.name} into account."
        return Function(f"update_{sensor.name}", arguments, schedule(t, taken | {a.name for a in arguments}), what)

    def _gate(self, t: Trace, sensor: SensorModel, nis: Value) -> None:
        """End the update where nis exceeds its quantile; after reset_after rejections take it all the same."""
        assert sensor.gate is not None
        t.section("gate")
        fails = nis > t.value(chi2_quantile(sensor.gate, len(sensor.h)))
        before = [Store("kf.nis", None, nis.node)]
        limit = sensor.spec.gate.reset_after if sensor.spec.gate is not None else None
        if counts_gated(self.model, sensor):
            count = t.wrapped(t.pool.make("field", (), f"kf.gate_count_{sensor.name}", "int"))
            before.append(Store(f"kf.gate_count_{sensor.name}", None, (count + 1).node))
            if limit is not None:
                fails = t.wrapped(t.pool.both(fails.node, (count < limit).node))
                t.guard(fails, "GATED", before=before)
                t.flag(nis > t.value(chi2_quantile(sensor.gate, len(sensor.h))), "ANOMALY")
                return
        t.guard(fails, "GATED", before=before)

    def _sequence(self, t: Trace, sensor: SensorModel, innovation: Innovation) -> _Updated:
        """All components, one scalar measurement after another."""
        layout = self.layout
        P = layout.load(t)
        moved: list[Any] = [0] * len(self.order)  # x - prior
        rows, variances, y = innovation.rows, innovation.variances, innovation.y
        names = [c.name for c in sensor.spec.components]
        nis: Any = 0
        likelihood: Any = 0  # -2 log
        every_s: list[Value] = []
        failures: list[Value] = []
        for first in range(0, len(rows), layout.group):
            part = range(first, min(first + layout.group, len(rows)))
            t.section("gain and covariance" + (": " + ", ".join(names[c] for c in part) if len(rows) > 1 else ""))
            below = [0 if is_positive(variances[c]) else layout.tolerance(P, rows[c]) for c in part]
            P, gains, s = layout.update(t, P, [rows[c] for c in part], [variances[c] for c in part])
            for c, K, variance, low in zip(part, gains, s, below, strict=True):
                t.name(variance, f"s_{names[c]}")
                correction = linalg.dot(rows[c], moved)
                nu = y[c] if is_zero(correction) else t.name(y[c] - correction, f"nu_{names[c]}")
                moved = [linalg.plus(m, linalg.times(k, nu)) for m, k in zip(moved, K, strict=True)]
                square = nu * (nu * (1 / variance))  # the gain has made the reciprocal
                if is_positive(variances[c]):
                    failures.append(~(variance > 0))
                else:  # a direction already known, measured exactly: skipped
                    square = t.select(variance > 0, square, 0)
                    failures.append(variance < -low)
                nis = linalg.plus(nis, square)
                if self.model.spec.code.log_likelihood:
                    term = square + t.function("log", variance) + t.value(log_two_pi())
                    known = is_positive(variances[c])
                    likelihood = linalg.plus(likelihood, term if known else t.select(variance > 0, term, 0))
                every_s.append(variance)
        t.section("state and innovation squared")
        nis = t.name(nis, "nis")
        x = [t.zero] * len(moved)
        for place, m in zip(self.order, moved, strict=True):
            prior = t.element("kf.x", place)
            x[place] = t.name(linalg.plus(prior, m), f"{self.model.states[place]}_next")
        likelihood = t.value(likelihood) * Fraction(-1, 2)
        return _Updated(x, P, nis, every_s, failures, likelihood)

    # ends --------------------------------------------------------------------------------------------

    def _limited(self, t: Trace, P: Covariance) -> Covariance:
        """variance_floor and variance_ceiling."""
        floors = [self.model.floors[i] for i in self.order]
        ceilings = [self.model.ceilings[i] for i in self.order]
        if not any(v is not None for v in (*floors, *ceilings)):
            return P
        t.section("limits of the variances")
        return self.layout.limit(t, P, floors, ceilings)

    def _unconfined(self, x: list[Value]) -> list[Value]:
        """States before their bounds, which would hide what is infinite."""
        return [v for v, bounds in zip(x, self.model.bounds, strict=True) if bounds is not None]

    def _guard_doubts(self, t: Trace, values: list[Value]) -> None:
        """NOT_POSITIVE where a variance that had to be taken on trust is negative, after NOT_FINITE of the model."""
        if t.doubts:
            self._guard_finite(t, values)
            for condition, why in t.doubts:
                t.guard(condition, "NOT_POSITIVE", why)

    def _guard_inputs(self, t: Trace) -> None:
        for name in self.model.inputs:  # one by one: the sum of large numbers would overflow
            t.guard(~t.finite(t.field(f"u.{name}")), "NOT_FINITE")

    def _guard_finite(self, t: Trace, values: list[Value]) -> None:
        """One test for all: a sum is finite only if its terms are."""
        live = list({v.node: v for v in values if v.constant is None}.values())
        if live:
            t.guard(~t.finite(sum(live[1:], live[0])), "NOT_FINITE")

    def _guard_positive(self, t: Trace, failures: list[Value]) -> None:
        live = [f for f in failures if f.constant != 0]
        if live:
            t.guard(reduce(or_, live), "NOT_POSITIVE")

    def _store(self, t: Trace, x: list[Value], moved: set[int], P: Covariance, after_predict: bool) -> None:
        t.section("store")
        for i in sorted(moved):
            t.store("kf.x", i, x[i])
        self.layout.store(t, P, self.names, after_predict)


@dataclass(frozen=True)
class _Updated:
    """After all components: x in the spec's order, P, nis, the variances s, and the conditions of failure."""

    x: list[Value]
    P: Covariance
    nis: Value
    s: list[Value]
    failures: list[Value]
    log_likelihood: Value
