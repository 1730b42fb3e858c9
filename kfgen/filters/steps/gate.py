"""The gate of a sensor: the whole vector is refused where its nis exceeds the chi-square quantile, or a threshold."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from operator import and_

from kfgen.filters.algebra.numbers import select
from kfgen.filters.steps.state import counts_gated
from kfgen.ir.lower import Lowering
from kfgen.ir.program import Store
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import chi2_quantile


def gate(t: Trace, model: Model, sensors: list[SensorModel], nis: list[Value], used: list[Value] | None) -> None:
    """End the update where nis is beyond the gate; after reset_after rejections take it all the same.

    A bank has the sensor and nis of each of its modes, and refuses what all of them refuse. used: whether each
    component counts, where a mask tells.
    """
    gates = [sensor.gate for sensor in sensors if sensor.gate is not None]
    if len(gates) < len(sensors):
        return
    t.section("gate")
    m = sensors[0].dimension
    beyond = reduce(and_, [v > _threshold(t, model, s, m, used) for s, v in zip(sensors, nis, strict=True)])
    before = [Store("kf.nis", None, smallest(t, nis).node)]
    if not counts_gated(model, sensors):
        t.guard(beyond, "GATED", before=before)
        return
    path = f"kf.gate_count_{sensors[0].name}"
    count = t.wrapped(t.pool.make("field", (), path, "int"))
    before.append(Store(path, None, (count + 1).node))
    limits = [s.spec.gate.reset_after for s in sensors if s.spec.gate and s.spec.gate.reset_after is not None]
    if not limits:
        t.guard(beyond, "GATED", before=before)
        return
    t.guard(beyond & (count < min(limits)), "GATED", before=before)
    t.flag(beyond, "ANOMALY")


def tested(t: Trace, model: Model, sensors: list[SensorModel]) -> None:
    """NOT_FINITE where a threshold is a formula that overflows."""
    for sensor in sensors:
        if sensor.gate is not None and sensor.gate.threshold is not None:
            value = _threshold(t, model, sensor, 1, None)
            if value.constant is None and value.node.op != "field":
                t.guard(~t.finite(value), "NOT_FINITE")


def _threshold(t: Trace, model: Model, sensor: SensorModel, m: int, used: list[Value] | None) -> Value:
    gate = sensor.gate
    assert gate is not None
    if gate.probability is not None:
        return chi2_threshold(t, gate.probability, m, used)
    values = {model.symbols[name]: t.field(f"kf.parameters.{name}") for name, _ in model.parameters}
    values |= {model.symbols[name]: t.field(f"u.{name}") for name in model.inputs}
    values |= {model.symbols[name]: t.field(f"z.{name}") for name in sensor.inputs}
    return Lowering(t, values)(gate.threshold)


def smallest(t: Trace, values: list[Value]) -> Value:
    return reduce(lambda a, b: t.function("min", a, b), values)


def store_outcome(
    t: Trace,
    model: Model,
    sensors: list[SensorModel],
    nis: list[Value],
    log_likelihood: Value,
    fields: Sequence[str] = (),
) -> None:
    """What an accepted update leaves beside the estimate. fields: where a bank keeps the nis of each of its modes."""
    if counts_gated(model, sensors):
        t.store(f"kf.gate_count_{sensors[0].name}", None, t.wrapped(t.pool.integer(0)))
    for path, value in zip(fields, nis, strict=bool(fields)):
        t.store(path, None, value)
    t.store("kf.nis", None, smallest(t, nis))
    if model.spec.code.log_likelihood:
        t.store("kf.log_likelihood", None, log_likelihood)


def chi2_threshold(t: Trace, probability: Fraction, m: int, used: list[Value] | None) -> Value:
    """The quantile for as many degrees of freedom as of m components count."""
    whole = t.value(chi2_quantile(probability, m))
    if used is None or m == 1:
        return whole
    one, none = t.wrapped(t.pool.integer(1)), t.wrapped(t.pool.integer(0))
    count = sum((select(u, one, none) for u in used[1:]), select(used[0], one, none))
    for k in reversed(range(1, m)):
        whole = select(count <= k, t.value(chi2_quantile(probability, k)), whole)
    return t.name(whole, "threshold")
