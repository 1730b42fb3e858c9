"""A short run of the integers beside the real numbers: whether what was chosen carries the filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic.limits import LEAST, LIMIT
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.program.cells import Cell
from kfgen.fixed.ranges.memory import Memory, blank
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.runs import Columns, elapsed, readings
from kfgen.fixed.trial.integers import IntegerProgram
from kfgen.spec.types import Sensor

SHAKEN = 2.0**-11  # of a covariance: what a format of 12 bits would lose in a step
LOOK = 4  # rows from one comparison of variances to the next
ERRORS = ("NOT_FINITE", "NOT_POSITIVE")


@dataclass(frozen=True)
class Departure:
    """The largest error of the integers: of which state, in standard deviations, and after which row.

    widest, share: the state whose variance is off most, and by which share of it.
    """

    state: int
    sigmas: float
    row: int
    errors: int  # calls that only the integers refused
    course: tuple[float, ...] = ()  # the error after each row
    widest: int = 0
    share: float = 0.0

    def beyond(self, other: Departure, least: float, factor: float) -> bool:
        """Whether an error is larger than `least`, and than `factor` times what the other has had by then."""
        had = accumulate(other.course, max)
        return any(not ours <= max(least, factor * theirs) for ours, theirs in zip(self.course, had, strict=True))


def shaken(real: RealProgram, code: FilterCode, formats: Formats, log: Columns, rows: int) -> Departure:
    """How far real numbers depart from themselves by digits that no format keeps.

    In every row of the second run x is rounded to its LSB, and the covariance is off by SHAKEN of itself.
    """
    return _Shaken(real, code, formats).run(log, rows)


def probe(real: RealProgram, code: FilterCode, program: IntegerProgram, integer: FilterCode, formats: Formats,
          log: Columns, rows: int) -> Departure:  # fmt: skip
    """Run both over a log, each from its own init."""
    return Probe(real, program, code, formats, integer).run(log, rows)


class Probe:
    """Two filters over one log: `a` of real numbers, `b` of integers."""

    def __init__(self, real: RealProgram, integer: RealProgram, code: FilterCode, formats: Formats,
                 lowered: FilterCode) -> None:  # fmt: skip
        self.real = real
        self.integer = integer
        self.code = code
        self.names = {f.name for f in code.functions}
        self.spec = code.model.spec
        self.formats = formats
        self.a = blank(code)
        self.lowered = lowered
        self.b = integers(blank(lowered))
        self.refused = 0

    def raw(self, cell: Cell, value: float) -> int:
        scaled = math.floor(math.ldexp(value, -self.formats.fixed[cell]) + 0.5)
        return max(LEAST, min(LIMIT, scaled))

    def give(self, cell: Cell, path: str, value: float) -> None:
        """The same number to both: what the integers can carry."""
        raw = self.raw(cell, value)
        self.b.numbers[path] = raw
        self.a.numbers[path] = math.ldexp(raw, self.formats.fixed[cell])

    def read(self, sensor: Sensor, values: Sequence[float]) -> None:
        """Give a reading."""
        for c, v in zip(sensor.fields, values, strict=True):
            self.give(("number", f"update_{sensor.name}", f"z.{c.name}"), f"z.{c.name}", v)

    def call(self, function: str) -> None:
        one, two = self.real.run(function, self.a), self.integer.run(function, self.b)
        self.refused += two in ERRORS and one not in ERRORS

    def run(self, log: Columns, rows: int) -> Departure:
        self.call("init")
        run_time = self.spec.dt is not None and self.spec.dt.run_time
        worst = Departure(0, 0.0, 0, 0)
        course, widest, share = [], 0, 0.0
        for k in range(rows):
            for each in self.spec.inputs:
                self.give(("number", f"u.{each.name}"), f"u.{each.name}", float(log[each.name][k]))
            step = elapsed(log, k) if run_time else 0.0
            if run_time:
                self.give(("number", "dt"), "dt", step)
            if not run_time or step != 0:
                self.call("predict")
            for sensor in self.spec.measurements:
                values = readings(log, sensor, k)
                if not any(map(math.isnan, values)):
                    self.read(sensor, values)
                    self.call(f"update_{sensor.name}")
            self.between()
            state, sigmas = self.error()
            course.append(sigmas)
            if not sigmas <= worst.sigmas:
                worst = Departure(state, sigmas, k, 0)
            if k % LOOK == 0:
                for i, off in enumerate(self.shares()):
                    widest, share = (widest, share) if off <= share else (i, off)
        self._others()
        return replace(worst, errors=self.refused, course=tuple(course), widest=widest, share=share)

    def between(self) -> None:
        """What is done after each row."""

    def value(self, i: int) -> float:
        """State i of b."""
        return math.ldexp(self.b.arrays["kf.x"][i], self._lsb(i))

    def _lsb(self, i: int) -> int:
        return self.formats.fixed[self.formats.arrays.state(i)]

    def _others(self) -> None:
        """What the run has not needed, once, in integers only."""
        for f in self.code.functions:
            if f.private or f.name in ("init", "predict") or f"{f.name}_masked" in self.names:
                continue
            other = self.b.copy()
            other.numbers["mask"] = 1
            if f.name.startswith("set_"):
                if f.name == "set_state":
                    other.arrays["x"] = list(other.arrays["kf.x"])
                elif f.name.replace("set_", "get_") in self.names:
                    self.integer.run(f.name.replace("set_", "get_"), other)
            if not f.name.startswith("update_") or f.name.endswith("_masked"):
                self.integer.run(f.name, other)

    def shares(self, least: Sequence[float] = ()) -> list[float]:
        """By which share of itself each variance (n) is off, less its LSB; 0 where it is no more than `least`."""
        n = len(self.code.model.errors)
        if "get_covariance" not in self.names:
            return [0.0] * n
        other = self.b.copy()
        self.integer.run("get_covariance", other)
        out = []
        for i, wanted in enumerate(self.real.variances(self.a, n)):
            e = self.formats.fixed[self.formats.arrays.variance(i, n)]
            off = abs(self.variance(other.arrays["P"][i * n + i], e) - wanted) - math.ldexp(1.0, e)
            out.append(off / wanted if wanted > (least[i] if least else 0.0) else 0.0)
        return out

    def variance(self, value: float, e: int) -> float:
        """A variance as b has it, its LSB 2^e."""
        return math.ldexp(value, e)

    def error(self, vanished: float = 0.0) -> tuple[int, float]:
        """The largest error of a state, in standard deviations, and of which.

        vanished: the share of its first variance below which a state is not looked at.
        """
        space = self.code.model.space
        n = space.dimension
        variances = [math.inf] * n
        if any(f.name == "get_covariance" for f in self.code.functions):
            self.real.run("get_covariance", self.a)
            variances = [self.a.arrays["P"][i * n + i] for i in range(n)]
        worst = (0, 0.0)
        apart = space.local(self.a.arrays["kf.x"], [self.value(i) for i in range(space.size)])
        for j, i in enumerate(space.numbers_of):
            if i is None:
                continue
            error = max(0.0, abs(apart[j]) - math.ldexp(4.0, self._lsb(i)))
            sigma = math.sqrt(max(variances[j], 0.0))
            least = 1e-9 * (1e-300 + abs(self.a.arrays["kf.x"][i]))
            known = sigma > least and variances[j] > vanished * float(self.code.model.P0[j][j])
            ratio = error / sigma if known else 0.0
            if not ratio <= worst[1]:
                worst = (i, ratio)
        return worst


class Shaking(Probe):
    """`b` is of real numbers too, a little off: after each row x is rounded to its LSB, and P shaken."""

    sign = 1.0

    def give(self, cell: Cell, path: str, value: float) -> None:
        super().give(cell, path, value)
        self.b.numbers[path] = self.a.numbers[path]

    def value(self, i: int) -> float:
        return float(self.b.arrays["kf.x"][i])

    def variance(self, value: float, e: int) -> float:
        return value

    def between(self) -> None:
        x = self.b.arrays["kf.x"]
        for i in range(len(self.code.model.states)):
            if math.isfinite(x[i]):
                x[i] = math.ldexp(math.floor(math.ldexp(x[i], -self._lsb(i)) + 0.5), self._lsb(i))
        if {"get_covariance", "set_covariance"} <= self.names:
            self.real.run("get_covariance", self.b)
            self.sign = -self.sign
            self.b.arrays["P"] = [(1.0 + self.sign * SHAKEN) * p for p in self.b.arrays["P"]]
            self.real.run("set_covariance", self.b)

    def _others(self) -> None:
        pass


class _Shaken(Shaking):
    """Over a log."""

    def __init__(self, real: RealProgram, code: FilterCode, formats: Formats) -> None:
        super().__init__(real, real, code, formats, code)
        self.b = blank(code)


def integers(memory: Memory) -> Memory:
    return Memory(
        {name: [0] * len(values) for name, values in memory.arrays.items()},
        {name: value if isinstance(value, bool) else 0 for name, value in memory.numbers.items()},
    )
