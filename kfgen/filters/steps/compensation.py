"""States whose rounding is carried on in a second word (Kahan 1965): x + x_rest is what the filter knows of them.

A step of 0.15 m is lost on a float of 4e6 m, whose last digit is half a metre. With the second word what a sum rounds
away is added to the next one, and a residual sees all of the state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from kfgen.filters.algebra.linalg import Vector, minus, plus, times
from kfgen.filters.algebra.numbers import is_zero, select
from kfgen.filters.base import Block
from kfgen.filters.steps.motion import compensated
from kfgen.filters.steps.sensor import Linearised
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model

FIELD = "x_rest"

Rests = dict[int, Value]
"""State -> what x lacks of it."""


class Compensation:
    """The second words of a filter's states."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.states = compensated(model)
        self.place = {state: k for k, state in enumerate(self.states)}

    def blocks(self) -> list[Block]:
        if not self.states:
            return []
        names = ", ".join(self.model.states[i] for i in self.states)
        doc = f"what rounding has left of {names}: x + x_rest is the estimate"
        entries = tuple(f"{self.model.states[i]}_rest" for i in self.states)
        zeros = (Fraction(0),) * len(self.states)
        return [Block(FIELD, len(self.states), doc, initial=zeros, entries=entries)]

    def given(self, t: Trace) -> Rests:
        """As they stand in the struct."""
        return {i: t.element(f"kf.{FIELD}", k) for i, k in self.place.items()}

    def moved(self, t: Trace, x: list[Value], steps: Mapping[int, Value]) -> tuple[list[Value], Rests]:
        """x (n,) moved by its steps, and the new rests; states without a step, or whose step is 0, stay."""
        out, given, rests = list(x), self.given(t), {}
        for i, step in steps.items():
            if is_zero(step):
                continue
            name = self.model.states[i]
            term = t.name(step + given[i], f"{name}_step")
            out[i] = t.name(x[i] + term, f"{name}_next")
            taken = t.name(out[i] - x[i], f"{name}_taken")  # a local of its own: the order of these sums is all
            rests[i] = t.name(term - taken, f"{name}_rest_next")
        return out, rests

    def corrected(self, t: Trace, linear: Linearised, order: list[int], rests: Rests | None = None) -> Linearised:
        """The residuals of a linearisation at x, as x + x_rest has them. rests: other than the struct's."""
        if not self.states:
            return linear
        rests = self.given(t) if rests is None else rests
        y: Vector = []
        for residual, row in zip(linear.y, linear.H, strict=True):
            seen = residual
            for place, i in enumerate(order):
                if i in rests:
                    seen = minus(seen, times(row[place], rests[i]))
            y.append(t.value(seen))
        return replace(linear, y=y)

    def store(self, t: Trace, rests: Rests, free: list[Value], x: list[Value]) -> None:
        """free, x (n,): before and after bounds, which leave nothing over."""
        for i, rest in rests.items():
            limited = self.model.bounds[i] is not None
            t.store(f"kf.{FIELD}", self.place[i], select(free[i] <= x[i], select(free[i] >= x[i], rest, 0), 0)
                    if limited else rest)  # fmt: skip

    def clear(self, t: Trace) -> None:
        """Nothing is left of a state that has been set."""
        for k in range(len(self.states)):
            t.store(f"kf.{FIELD}", k, t.zero)


def with_means(steps: Mapping[int, Value], means: Vector) -> dict[int, Value]:
    """Steps (of some states) with what a second order adds to all (n,)."""
    return {i: plus(step, means[i]) for i, step in steps.items()}
