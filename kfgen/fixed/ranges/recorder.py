"""A filter of real numbers that is driven over the declared box, and the ranges of all that it computes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from kfgen.fixed.ranges.box import Box, clipped
from kfgen.fixed.ranges.legs import Leg
from kfgen.fixed.ranges.memory import blank
from kfgen.fixed.ranges.runs import Runner

BEGUN = 1.05  # times the first variance
BEYOND = 1.0  # times the width of its range that an estimate may be outside of it


class Recorder:
    """A player that records what a filter computes, until its estimate leaves the box or the numbers.

    limits (n): variances, beyond which a leg ends; none where they may be any.
    """

    def __init__(self, runner: Runner, box: Box, limits: Sequence[float] = ()) -> None:
        self.runner = runner
        self.box = box
        self.limits = limits
        self.memory = self.before = blank(runner.code)
        runner.program.run("init", self.memory)

    def begin(self, leg: Leg) -> None:
        runner = self.runner
        if leg.fresh:
            self.memory = blank(runner.code)
            runner.program.run("init", self.memory)
        for name, value in leg.parameters.items():
            self.memory.numbers[f"kf.parameters.{name}"] = value
            runner.ranges.see(("number", f"kf.parameters.{name}"), value)

    def estimate(self) -> list[float]:
        return list(self.memory.arrays["kf.x"])

    def place(self, x: Sequence[float]) -> None:
        self.runner.place(self.memory, x)

    def row(self, inputs: Mapping[str, float], dt: float, readings: Mapping[str, Sequence[float]], k: int) -> bool:
        before, seen = self.memory.copy(), self.runner.ranges.copy()
        self.runner.row(self.memory, inputs, dt, readings, k)
        x = self.memory.arrays["kf.x"]
        if within(self.box, x, self.limits, lambda: self.runner.variances(self.memory)):
            return True
        self.runner.ranges.restore(seen)
        self.memory = before
        return False


def within(box: Box, x: Sequence[float], limits: Sequence[float], variances: Callable[[], Sequence[float]]) -> bool:
    """Whether an estimate is not far outside of the box, and no variance beyond its limit."""
    for value, span in zip(x, box.states, strict=True):
        if not math.isfinite(value):
            return False
        if span is not None and abs(value - clipped(value, span)) > BEYOND * (span[1] - span[0]):
            return False
    return not limits or all(v <= most for v, most in zip(variances(), limits, strict=True))


def unknown(box: Box, first: Sequence[float]) -> list[float]:
    """Variances (n) at which a state is as good as unknown: a deviation of half its span, or what it begins with.

    first (n): the variances at the start.
    """
    spans = [None if i is None else box.states[i] for i in box.numbers]
    return [
        math.inf if span is None else max(((span[1] - span[0]) / 2) ** 2, BEGUN * P)
        for span, P in zip(spans, first, strict=True)
    ]
