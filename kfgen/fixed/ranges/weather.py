"""Logs drawn from a filter's own model, for ranges: fast, and the same on every machine.

The truth is stepped by f; all noises are added as the filter sees them, linearised at the truth. Inputs are slow
sines within their ranges.
"""

from __future__ import annotations

import math

from kfgen.filters.base import FilterCode
from kfgen.fixed.ranges import declared
from kfgen.fixed.ranges.box import Span, box_of
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.truth import Truth
from kfgen.spec.sensors import columns_of

Wave = tuple[float, float, list[tuple[float, float]]]
"""The middle of an input, the size of its swing, and three periods (in steps) with their phases."""
JITTER = 0.1
DWELL = 30


class Weather:
    """Draws logs of a filter's model. Columns are named as in a log file.

    The truth of a bank follows its modes in turn, each for DWELL rows or so.
    """

    def __init__(self, code: FilterCode) -> None:
        self.model = code.model
        self.spec = code.model.spec
        self.box = box_of(code.model)
        self.truth = Truth(code, self.box)
        self.modes = len(self.truth.models)
        self.n = self.truth.n
        self.run_time = self.truth.run_time
        self.nominal = declared.number(self.spec.dt.nominal, self.spec) if self.spec.dt is not None else 1.0

    def log(self, rows: int, random: Random, reading: Random, first: int = 0) -> tuple[dict[str, list[float]], int]:
        """Columns, and how many rows there are: fewer than asked for where the model leaves the numbers.

        random: for the truth; reading: for the noise of the sensors; first: the mode to begin with.
        """
        model, truth = self.model, self.truth
        truth.begin(random)
        numbers = truth.memory.numbers
        names = [columns_of(s.spec) for s in model.sensors]
        columns: dict[str, list[float]] = {c: [] for c in ("t", *model.inputs, *(c for each in names for c in each))}
        inputs = [self._input(self.box.inputs.get(name), random) for name in model.inputs]
        own = [[self._input(self.box.readings.get((s.name, name)), random) for name in s.inputs] for s in model.sensors]
        mode, left = first, self._dwell(random)
        for k in range(rows):
            if left == 0:
                mode, left = (mode + 1) % self.modes, self._dwell(random)
            left -= 1
            for name, wave in zip(model.inputs, inputs, strict=True):
                numbers[f"u.{name}"] = _at(wave, k)
            if k or not self.run_time:
                dt = self.nominal
                if self.run_time:
                    dt = self._clamped(dt * (1 + JITTER * (2 * random.random() - 1)))
                if not truth.step(mode, dt, random):
                    return columns, k
            columns["t"].append(truth.now)
            for name in model.inputs:
                columns[name].append(numbers[f"u.{name}"])
            for i, each in enumerate(names):
                given = [_at(wave, k) for wave in own[i]]
                for name, z in zip(each, [*truth.see(mode, i, reading, given), *given], strict=True):
                    columns[name].append(z)
        return columns, rows

    def _dwell(self, random: Random) -> int:
        """Rows for which the truth keeps its mode; those of a filter by itself are without end."""
        return -1 if self.modes == 1 else 1 + int(2 * DWELL * random.random())

    def process_noise(self) -> list[list[float]]:
        """The variance that a step of each mode adds to each state (modes, n), at the initial state."""
        out = []
        for first in range(self.modes):
            self.log(1 + self.run_time, Random(1), Random(2), first)
            out.append([max(self.truth.last[i * self.n + i], 0.0) for i in range(self.n)])
        return out

    def _clamped(self, dt: float) -> float:
        low, high = self.model.dt_limits
        dt = dt if low is None else max(dt, float(low))
        return dt if high is None else min(dt, float(high))

    def _input(self, span: Span | None, random: Random) -> Wave:
        """Of an input of that range."""
        middle, amplitude = (0.0, 1.0) if span is None else ((span[0] + span[1]) / 2, (span[1] - span[0]) / 8)
        waves = [(25.0 * 10 ** random.random(), 2 * math.pi * random.random()) for _ in range(3)]
        return middle, amplitude, waves


def _at(wave: Wave, k: int) -> float:
    """An input in row k."""
    middle, amplitude, waves = wave
    drive = sum(math.sin(2 * math.pi * k / period + phase) for period, phase in waves) / len(waves)
    return middle + amplitude * drive
