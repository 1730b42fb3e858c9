"""The gate of a sensor: the whole vector is refused where its nis exceeds the chi-square quantile."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.numbers import select
from kfgen.filters.state import counts_gated
from kfgen.ir.program import Store
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import chi2_quantile


def gate(t: Trace, model: Model, sensor: SensorModel, nis: Value, used: list[Value] | None) -> None:
    """End the update where nis is beyond the gate; after reset_after rejections take it all the same.

    used: whether each component counts, where a mask tells.
    """
    if sensor.gate is None:
        return
    t.section("gate")
    beyond = nis > chi2_threshold(t, sensor.gate, len(sensor.h), used)
    before = [Store("kf.nis", None, nis.node)]
    if not counts_gated(model, sensor):
        t.guard(beyond, "GATED", before=before)
        return
    path = f"kf.gate_count_{sensor.name}"
    count = t.wrapped(t.pool.make("field", (), path, "int"))
    before.append(Store(path, None, (count + 1).node))
    limit = sensor.spec.gate.reset_after if sensor.spec.gate is not None else None
    if limit is None:
        t.guard(beyond, "GATED", before=before)
        return
    t.guard(beyond & (count < limit), "GATED", before=before)
    t.flag(beyond, "ANOMALY")


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
