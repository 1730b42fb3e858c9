"""The real program over a log, row by row: its predictions, its updates, and what is called beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from kfgen.filters.base import FilterCode
from kfgen.filters.steps.outputs import FUNCTION
from kfgen.fixed.ranges.memory import Memory, blank
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.spec.sensors import columns_of
from kfgen.spec.types import Sensor

Columns = Mapping[str, Sequence[float]]
Watcher = Callable[[int, int, Memory, Callable[[], object]], None]  # makes row k's step of `rows`, and looks at it
CORRELATED = 75  # rows between two covariances that are given
OUTAGE = 60  # rows without any reading, or fewer where a variance grows
GROWN = 2.0**14  # times in them: more than that says no more than that a state is unknown
EVERY = 16  # rows between two calls of the functions that a run does not need


def elapsed(log: Columns, k: int) -> float:
    """The time from the row before to row k [s]; 0 at the first."""
    return float(log["t"][k]) - float(log["t"][k - 1]) if k else 0.0


def readings(log: Columns, sensor: Sensor, k: int) -> list[float]:
    """What a sensor's components read in row k, and its own inputs; NaN where nothing was."""
    columns = [log.get(name) for name in columns_of(sensor)]
    return [math.nan if column is None else float(column[k]) for column in columns]


class Runner:
    """Runs the filter over the rows of logs and records the ranges of all that it computes."""

    def __init__(self, code: FilterCode, program: RealProgram, ranges: Ranges) -> None:
        self.code = code
        self.program = program
        self.ranges = ranges
        self.spec = code.model.spec
        self.names = {f.name for f in code.functions}
        self.run_time = self.spec.dt is not None and self.spec.dt.run_time
        self.heard: set[str] = set()  # the sensors that have been read
        self.limits: list[float] = []  # of variances: an update that inflates one beyond its own is as if not made

    def run(self, log: Columns, rows: int, correlation: float = 0.0, every: int = 1,
            watch: Watcher | None = None, start: tuple[Memory, int] | None = None) -> Memory:  # fmt: skip
        """A whole log, as `kfgen run` would: predict, then the updates in the spec's order.

        correlation: the states are given this one now and then, so that no part of a covariance is taken for zero
        only because the first one is diagonal. every: rows from one reading of a sensor to the next; beyond 1 there
        is a gap of OUTAGE rows as well. watch: makes the steps, and sees them. start: where another run has ended, and
        the row to go on with.
        """
        memory, first = (blank(self.code), 0) if start is None else start
        if start is None:
            self.program.run("init", memory)
        self._look(memory)
        least: list[float] = []  # variances of the rows before the outage
        for k in range(first, rows):
            if correlation and k % CORRELATED == 0:
                self._correlate(memory, correlation)
            self._inputs(memory, log, k)
            if self._step(memory, log, k):
                if watch is None:
                    self.program.run("predict", memory)
                else:
                    watch(k - first, rows - first, memory, lambda: self.program.run("predict", memory))
                self._look(memory)
            if every > 1 and rows < 2 * k < rows + 2 * OUTAGE and not self._grown(memory, least):
                continue
            for place, sensor in enumerate(self.spec.measurements):
                if (k + place) % every == 0:
                    self._limited(memory, sensor, readings(log, sensor, k), k)
            self._tell(memory)
            if every > 1 and rows - 2 * OUTAGE < 2 * k <= rows:
                found = self.variances(memory)
                least = [min(pair) for pair in zip(least or found, found, strict=True)]
            if k % EVERY == 0 or k == rows - 1:
                self._others(memory, k)
        return memory

    def row(self, memory: Memory, inputs: Mapping[str, float], dt: float, readings: Mapping[str, Sequence[float]],
            k: int) -> None:  # fmt: skip
        """A prediction, and the update of every sensor. inputs, readings: by name. k: the row's number."""
        for name, value in inputs.items():
            memory.numbers[f"u.{name}"] = value
            self.ranges.see(("number", f"u.{name}"), value)
        if self.run_time:
            memory.numbers["dt"] = dt
            self.ranges.see(("number", "dt"), dt)
        self.program.run("predict", memory)
        self._look(memory)
        for sensor in self.spec.measurements:
            if sensor.name in readings:
                self._limited(memory, sensor, readings[sensor.name], k)
        self._tell(memory)
        if k % EVERY == 0:
            self._others(memory, k)

    def place(self, memory: Memory, x: Sequence[float]) -> None:
        """Put the estimate to x (n)."""
        memory.arrays["x"] = list(x)
        self.program.run("set_state", memory)
        self._look(memory)

    def _correlate(self, memory: Memory, correlation: float) -> None:
        if "set_covariance" not in self.names:
            return
        n = len(self.code.model.errors)
        self.program.run("get_covariance", memory)
        P = memory.arrays["P"]
        root = [math.sqrt(max(P[i * n + i], 0.0)) for i in range(n)]
        sign = [1 if i % 2 or correlation > 0 else -1 for i in range(n)]
        memory.arrays["P"] = [
            root[i] * root[j] * (1.0 if i == j else abs(correlation) * sign[i] * sign[j])
            for i in range(n) for j in range(n)
        ]  # fmt: skip
        self.program.run("set_covariance", memory)
        self._look(memory)

    def _limited(self, memory: Memory, sensor: Sensor, values: Sequence[float], k: int) -> None:
        if not self.limits:
            self._update(memory, sensor, values, k)
            return
        before, seen = memory.copy(), self.ranges.copy()
        self._update(memory, sensor, values, k)
        if any(new > limit for new, limit in zip(self.variances(memory), self.limits, strict=True)):
            self.ranges.restore(seen)
            memory.arrays, memory.numbers = before.arrays, before.numbers

    def _grown(self, memory: Memory, least: list[float]) -> bool:
        """Whether a variance has become so large in an outage that the state is as good as unknown."""
        found = self.variances(memory)
        return any(0 < old * GROWN < new for old, new in zip(least, found, strict=bool(least)))

    def variances(self, memory: Memory) -> list[float]:
        """P_ii (n); 0 where the filter does not say."""
        n = len(self.code.model.errors)
        return self.program.variances(memory, n) if "get_covariance" in self.names else [0.0] * n

    def rescale(self, memory: Memory, factors: Sequence[float]) -> None:
        """Multiply the standard deviations of the states, at the same correlations."""
        n = len(factors)
        self.program.run("get_covariance", memory)
        P = memory.arrays["P"]
        memory.arrays["P"] = [factors[i] * factors[j] * P[i * n + j] for i in range(n) for j in range(n)]
        self.program.run("set_covariance", memory)

    def _inputs(self, memory: Memory, log: Columns, k: int) -> None:
        for each in self.spec.inputs:
            value = float(log[each.name][k])
            if not math.isnan(value):
                memory.numbers[f"u.{each.name}"] = value
                self.ranges.see(("number", f"u.{each.name}"), value)

    def _step(self, memory: Memory, log: Columns, k: int) -> bool:
        if not self.run_time:
            return True
        step = elapsed(log, k)
        memory.numbers["dt"] = step
        self.ranges.see(("number", "dt"), step)
        return step != 0

    def _update(self, memory: Memory, sensor: Sensor, values: Sequence[float], k: int) -> None:
        there = [not math.isnan(v) for v in values[: len(sensor.components)]]
        if not any(there) or any(map(math.isnan, values[len(there) :])):
            return
        self.heard.add(sensor.name)
        name = f"update_{sensor.name}"
        for c, v in zip(sensor.fields, values, strict=True):
            memory.numbers[f"z.{c.name}"] = 0.0 if math.isnan(v) else v
            if not math.isnan(v):
                self.ranges.see(("number", name, f"z.{c.name}"), v)
        if all(there):
            if sensor.partial:
                other = memory.copy()
                other.numbers["mask"] = 1 + k % ((1 << len(there)) - 1)
                self.program.run(f"{name}_masked", other)
            self.program.run(name, memory)
        elif sensor.partial:
            memory.numbers["mask"] = sum(1 << i for i, known in enumerate(there) if known)
            self.program.run(f"{name}_masked", memory)
        self._look(memory)

    def _look(self, memory: Memory) -> None:
        """What the fields hold, whoever has stored it."""
        meet = self.ranges.meet
        for name, slots in self.slots:
            if isinstance(slots, int):
                meet(slots, memory.numbers[name])
            else:
                for slot, value in zip(slots, memory.arrays[name], strict=True):
                    meet(slot, value)

    @cached_property
    def slots(self) -> list[tuple[str, int | list[int]]]:
        """The fields that hold numbers, and the places of these among the ranges."""
        slot, found = self.ranges.slot, list[tuple[str, int | list[int]]]()
        for block in self.code.blocks:
            if block.kind == "real":
                name = f"kf.{block.name}"
                elements = [self.program.arrays.element(("array", name), i) for i in range(block.size or 0)]
                found.append((name, slot(("number", name)) if block.size is None else [slot(e) for e in elements]))
        return found

    def _tell(self, memory: Memory) -> None:
        """The outputs, where there are some."""
        if FUNCTION in self.names:
            self.program.run(FUNCTION, memory)

    def _others(self, memory: Memory, k: int) -> None:
        """Covariance and state out and in again, on copies."""
        other = memory.copy()
        if "get_covariance" in self.names:
            self.program.run("get_covariance", other)
        if "set_covariance" in self.names:
            P = list(other.arrays["P"])
            n = len(self.code.model.errors)
            for part in (P, [p if i % (n + 1) == 0 else 0.5 * p for i, p in enumerate(P)]):
                other.arrays["P"] = list(part)
                self.program.run("set_covariance", other)
            if "set_sqrt_covariance" in self.names:
                self.program.run("get_sqrt_covariance", other)
                self.program.run("set_sqrt_covariance", other)
        other = memory.copy()
        for name in sorted(self.names):
            if name == "redraw" or (name.startswith("get_") and name not in ("get_covariance", "get_sqrt_covariance")):
                self.program.run(name, other)
        other.arrays["x"] = list(other.arrays["kf.x"])
        self.program.run("set_state", other)
