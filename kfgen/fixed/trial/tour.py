"""The integers beside the real numbers, driven over the declared box."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic.operations import SATURATED, Status
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.ranges.box import Box
from kfgen.fixed.ranges.legs import Leg
from kfgen.fixed.ranges.memory import Memory, blank
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.recorder import within
from kfgen.fixed.trial.integers import IntegerProgram
from kfgen.fixed.trial.probe import ERRORS, LOOK, Probe, Shaking, integers
from kfgen.spec.types import Sensor

FAILING = 0.1  # standard deviations by which the integers may be off
WIDE = 0.2  # the share of itself by which a variance may be, all over the box
MARGIN = 0.7  # of that in a trial, which does not go everywhere
VANISHED = 2.0**-16  # of the first variance: what a noise of nothing has left
MASKED = 3  # rows from one reading of which parts are missing to the next
UNLIKELY = 2.0**10  # a NIS above that is no reading of this filter


@dataclass
class Found:
    """How far the integers have been off: of which state, in deviations; its variance, as a share; what else."""

    state: int = 0
    sigmas: float = 0.0
    widest: int = 0  # the state of the variance
    share: float = 0.0
    errors: int = 0
    rows: int = 0
    saturated: Counter[str] = field(default_factory=Counter)  # function -> rows in which something in it has

    @property
    def carried(self) -> bool:
        """Whether the integers have followed."""
        near = self.sigmas <= MARGIN * FAILING and self.share <= MARGIN * WIDE
        return near and not self.errors and not self.saturated


class Tour(Probe):
    """A player of both. After each leg it goes on from what the leg has left, as a filter does."""

    def __init__(self, real: RealProgram, integer: RealProgram, code: FilterCode, formats: Formats,
                 lowered: FilterCode, box: Box, limits: Sequence[float]) -> None:  # fmt: skip
        super().__init__(real, integer, code, formats, lowered)
        self.box = box
        self.limits = limits
        self.status, self.peaks = Status(), dict[int, int]()
        if isinstance(integer, IntegerProgram):
            self.status, self.peaks = integer.scalar.status, integer.peaks
        self.found = Found()
        self.vanishing = False
        self.full: list[str] = []  # functions that saturated in the row
        self.first = [float(row[i]) for i, row in enumerate(code.model.P0)]
        self.call("init")

    def begin(self, leg: Leg) -> None:
        self.vanishing = leg.vanishing
        if leg.fresh:
            self.a, self.b = blank(self.code), self.blank()
            self.call("init")
        for name, value in leg.parameters.items():
            self.give(("number", f"kf.parameters.{name}"), f"kf.parameters.{name}", value)

    def blank(self) -> Memory:
        """The memory of the integers before init."""
        return integers(blank(self.lowered))

    def given(self, raw: list[int]) -> list[float]:
        """A state as b takes it."""
        return list(raw)

    def estimate(self) -> list[float]:
        return list(self.a.arrays["kf.x"])

    def place(self, x: Sequence[float]) -> None:
        cells = [self.formats.arrays.state(i) for i in range(len(x))]
        raw = [self.raw(cell, value) for cell, value in zip(cells, x, strict=True)]
        self.a.arrays["x"] = [math.ldexp(r, self.formats.fixed[c]) for r, c in zip(raw, cells, strict=True)]
        self.b.arrays["x"] = self.given(raw)
        self.call("set_state")

    def row(self, inputs: Mapping[str, float], dt: float, readings: Mapping[str, Sequence[float]], k: int) -> bool:
        peaks, met = dict(self.peaks), self.real.ranges.copy()
        before = self.a.copy(), self.b.copy()
        if self._row(inputs, dt, readings, k):
            return True
        self.peaks.clear()  # what came when the leg had left the box tells nothing
        self.peaks.update(peaks)
        self.real.ranges.restore(met)
        self.a, self.b = before
        return False

    def _row(self, inputs: Mapping[str, float], dt: float, readings: Mapping[str, Sequence[float]], k: int) -> bool:
        for name, value in inputs.items():
            self.give(("number", f"u.{name}"), f"u.{name}", value)
        if self.spec.dt is not None and self.spec.dt.run_time:
            self.give(("number", "dt"), "dt", dt)
        self.full.clear()
        alike = self._tried("predict")
        for sensor in self.spec.measurements:
            if alike and sensor.name in readings:
                self.read(sensor, readings[sensor.name])
                alike = self._update(sensor, k)
        self.between()
        n = len(self.code.model.errors)
        x = self.a.arrays["kf.x"]
        if not alike or not within(self.box, x, self.limits, lambda: self.real.variances(self.a, n)):
            return False
        self.found.rows += 1
        self.found.saturated.update(self.full)
        state, sigmas = self.error(VANISHED if self.vanishing else 0.0)
        if not sigmas <= self.found.sigmas:
            self.found.state, self.found.sigmas = state, sigmas
        if k % LOOK == 0:
            least = [VANISHED * P for P in self.first] if self.vanishing else ()
            for i, share in enumerate(self.shares(least)):
                if not share <= self.found.share:
                    self.found.widest, self.found.share = i, share
        return True

    def _update(self, sensor: Sensor, k: int) -> bool:
        if not sensor.partial or k % MASKED:
            return self._tried(f"update_{sensor.name}")
        mask = 1 + (k // MASKED) % ((1 << len(sensor.components)) - 1)
        self.a.numbers["mask"] = self.b.numbers["mask"] = mask
        return self._tried(f"update_{sensor.name}_masked")

    def _tried(self, function: str) -> bool:
        """Call a function of both; whether both have taken it alike."""
        self.status.bits = 0
        one, two = self.real.run(function, self.a), self.integer.run(function, self.b)
        if self.status.bits & SATURATED:
            self.full.append(function)
        if one != two:
            self.found.errors += two in ERRORS and one not in ERRORS
            return False
        return one not in ERRORS and self.a.numbers.get("kf.nis", 0.0) <= UNLIKELY


class ShakenTour(Shaking, Tour):
    """Real numbers beside real numbers that are a little off: what no digit of a format could help."""

    def __init__(self, real: RealProgram, code: FilterCode, formats: Formats, box: Box,
                 limits: Sequence[float]) -> None:  # fmt: skip
        super().__init__(real, real, code, formats, code, box, limits)

    def blank(self) -> Memory:
        return blank(self.code)

    def given(self, raw: list[int]) -> list[float]:
        return list(self.a.arrays["x"])
