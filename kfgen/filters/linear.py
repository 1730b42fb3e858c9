"""The linearity that a kf asks of its model."""

from __future__ import annotations

from kfgen.errors import Mistake, Place, SpecError
from kfgen.filters import process
from kfgen.filters.dual import Dual, Evaluator, seeds
from kfgen.ir.nodes import Node
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model

_HINT = "use type: ekf, or make the equation linear"


def check_linear(model: Model) -> None:
    """SpecError naming every equation of f and h that is not linear, and in which states (or noises)."""
    mistakes: list[Mistake] = []
    t = Trace()
    step = process.step_length(t, model)
    prior = process.given(t, model, step)
    at = Evaluator(t, model, prior.duals)
    noises = [w.name for w in model.noises]
    for name, expression, place in zip(model.states, model.f, model.f_places, strict=True):
        _judge(mistakes, place, f"f of {name}", at(expression), [*model.states, *noises], model)
    for sensor in model.sensors:
        ts = Trace()
        given = seeds(ts, {s: ts.element("kf.x", i) for i, s in enumerate(model.states)})
        own = [w.name for w in sensor.noises]
        given.update(seeds(ts, {w: ts.field(f"noise.{w}") for w in own}))
        given.update(process.parameters_and_inputs(ts, model))
        given["t"] = process.time_now(ts, model)
        given["dt"] = Dual(ts.value(model.dt) if model.dt is not None else ts.field("dt"))
        evaluator = Evaluator(ts, model, given)
        for component, h in zip(sensor.spec.components, sensor.h, strict=True):
            what = f"h of {sensor.name}.{component.name}"
            _judge(mistakes, component.h.place, what, evaluator(h), [*model.states, *own], model)
    if mistakes:
        raise SpecError(mistakes)


def _judge(mistakes: list[Mistake], place: Place, what: str, dual: Dual, names: list[str], model: Model) -> None:
    """A derivative by a state that still depends on a state makes the equation non-linear in both."""
    guilty = [name for name in names if name in dual.gradient and _depends(dual.gradient[name], model)]
    if guilty:
        mistakes.append(Mistake(place, f"type: kf needs linear equations, and {what} is not linear in {', '.join(guilty)}", _HINT))


def _depends(value: Value, model: Model) -> bool:
    """Whether a traced value reads a state (or a sensor's noise)."""
    seen: set[Node] = set()
    stack = [value.node]
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        if node.op == "element" and node.data == "kf.x":
            return True
        if node.op == "field" and str(node.data).startswith("noise."):
            return True
        stack += node.args
    return False
