"""The box that a spec declares: within which states, inputs, parameters, readings and dt may lie, as floats."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from kfgen.fixed.ranges.declared import limits, number
from kfgen.model import Model
from kfgen.spec.types import Range

Span = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """Low and high of each quantity; None (and no entry) where nothing is declared.

    states (n): their bounds or ranges, or half a period to each side. readings: (sensor, component or input of its
    own) -> its range. dt: of a step that is given at run time, from its least to its greatest.
    """

    states: tuple[Span | None, ...]
    inputs: dict[str, Span]
    parameters: dict[str, Span]
    readings: dict[tuple[str, str], Span]
    dt: Span | None

    @property
    def wide(self) -> bool:
        """Whether anything is declared that a run as the model says does not go through by itself."""
        return bool(self.inputs or self.parameters or self.dt or any(self.states))

    def without_states(self) -> Box:
        """The same box of all else."""
        return replace(self, states=(None,) * len(self.states))

    def inside(self, i: int, value: float) -> float:
        """Brought into the span of state i."""
        return clipped(value, self.states[i])


def clipped(value: float, span: Span | None) -> float:
    """The value, or the end of the span that is next to it."""
    return value if span is None else min(max(value, span[0]), span[1])


def box_of(model: Model) -> Box:
    """The box of a model's spec."""
    spec = model.spec

    def span(declared: Range | None) -> Span | None:
        return None if declared is None else limits(declared, spec)

    states: list[Span | None] = []
    for state, bounds, period in zip(spec.states, model.bounds, model.periods, strict=True):
        if bounds is not None:
            states.append((float(bounds[0]), float(bounds[1])))
        elif period is not None:
            states.append((-float(period) / 2, float(period) / 2))
        else:
            states.append(span(state.range))
    values = dict(model.parameters)
    parameters = {}
    for parameter in spec.parameters:
        found = span(parameter.range)
        if found is not None:
            value = float(values[parameter.name])
            parameters[parameter.name] = (min(found[0], value), max(found[1], value))
    low, high = model.dt_limits
    return Box(
        states=tuple(states),
        inputs={each.name: limits(each.range, spec) for each in spec.inputs if each.range is not None},
        parameters=parameters,
        readings={
            (s.name, c.name): limits(c.range, spec)
            for s in spec.measurements for c in s.fields if c.range is not None
        },
        dt=_steps(low, high, model),
    )  # fmt: skip


def _steps(low: Fraction | None, high: Fraction | None, model: Model) -> Span | None:
    """From the least step to the greatest, or the nominal one where there is no such limit."""
    step = model.spec.dt
    if step is None or not step.run_time or (low is None and high is None):
        return None
    nominal = number(step.nominal, model.spec)
    return (nominal if low is None else float(low)), (nominal if high is None else float(high))
