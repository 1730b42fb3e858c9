"""What firmware reads of an estimate: outputs, functions of the state, with their standard deviations.

An output y = g(x) has the variance J P J^T, J = dg/dx at the estimate (Bar-Shalom, Li & Kirubarajan 2001, 1.4.15): of a
covariance that is kept as factors a sum of squares, of entries one that rounding may leave below 0, which is then 0.
"""

from __future__ import annotations

from collections.abc import Callable

from kfgen.filters.algebra.dual import Dual, Evaluator, seeds
from kfgen.filters.algebra.linalg import Rows
from kfgen.filters.algebra.numbers import Number, select, sqrt
from kfgen.filters.base import CONST_KF
from kfgen.filters.frame import guards
from kfgen.filters.steps import process
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model

FUNCTION = "get_outputs"
VALUE, DEVIATION = "value", "std"
"""Its arguments, structs with a field for each output."""

Variances = Callable[[Rows], list[Number]]
"""J (k, n) in the spec's order -> the diagonal of J P J^T (k,)."""


def outputs_function(t: Trace, model: Model, variances: Variances, taken: frozenset[str]) -> Function:
    """The function that tells the outputs of a filter; t: to trace it in."""
    guards.arguments(t)
    x = [t.element("kf.x", i) for i in range(len(model.states))]
    used = model.uses(*(output.value for output in model.outputs))
    for name, value in zip(model.states, x, strict=True):
        if name in used:
            t.name(value, name)
    given = seeds(t, dict(zip(model.states, x, strict=True)))
    given |= process.parameters_and_inputs(t, model, inputs=False)
    if "t" in used:
        given["t"] = process.time_now(t, model)
    if model.dt is not None:
        given["dt"] = Dual(t.value(model.dt))
    evaluator = Evaluator(t, model, given)
    t.section("outputs")
    values = [t.name(evaluator.value(output.value), output.name) for output in model.outputs]
    guards.finite(t, values)
    with t.when(t.present(DEVIATION)):
        t.section("their standard deviations: sqrt(J P J^T)")
        duals = [evaluator(output.value) for output in model.outputs]
        found = [t.value(v) for v in variances([[d.gradient.get(s, t.zero) for s in model.states] for d in duals])]
        for output, variance in zip(model.outputs, found, strict=True):
            t.name(variance, f"var_{output.name}")
        guards.finite(t, found)
        for output, variance in zip(model.outputs, found, strict=True):
            t.store(f"{DEVIATION}.{output.name}", None, _root(t, variance))
    for output, value in zip(model.outputs, values, strict=True):
        t.store(f"{VALUE}.{output.name}", None, value)
    guards.settled(t, model)
    kind = "{name}_outputs_t"
    arguments = [
        CONST_KF,
        Argument(VALUE, kind, pointer=True, constant=False, doc="outputs"),
        Argument(DEVIATION, kind, True, False, "their standard deviations, or NULL", optional=True),
    ]
    body = schedule(t, taken | {"x", "P", *(a.name for a in arguments)})
    return Function(FUNCTION, arguments, body, "The outputs at the present estimate, and how well they are known.")


def _root(t: Trace, variance: Value) -> Value:
    root: Value = sqrt(select(variance > 0, variance, 0))
    return t.value(root)
