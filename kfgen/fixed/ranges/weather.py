"""Logs drawn from a filter's own model, for ranges: fast, and the same on every machine.

The truth is stepped by f; all noises are added as the filter sees them, linearised at the truth. Inputs are slow
sines within their ranges.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from kfgen.filters.base import FilterCode
from kfgen.filters.steps import process
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.sensor import SensorCode, total
from kfgen.fixed.program.cells import find_arrays
from kfgen.fixed.ranges import declared
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.memory import Memory
from kfgen.fixed.ranges.ranges import HUGE, Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.model import Model
from kfgen.model.model import SensorModel

JITTER = 0.1
DWELL = 30


class Weather:
    """Draws logs of a filter's model. Columns are named as in a log file.

    The truth of a bank follows its modes in turn, each for DWELL rows or so.
    """

    def __init__(self, code: FilterCode) -> None:
        self.model = model = code.model
        self.models = [mode.model for mode in code.modes] or [model]
        self.spec = model.spec
        self.n = len(model.states)
        self.run_time = model.spec.dt is not None and model.spec.dt.run_time
        functions = []
        for b, mode in enumerate(self.models):
            functions += [self._step(mode, b), *(self._sensor(mode, b, k) for k in range(len(model.sensors)))]
        self.program = RealProgram(functions, find_arrays(functions), Ranges())
        self.limits = [self._limits(i) for i in range(self.n)]
        self.last = [0.0] * self.n**2  # Q of the last step

    def _step(self, model: Model, b: int) -> Function:
        t, n = Trace(), self.n
        step = Step(t.field("dt") if self.run_time else None if model.dt is None else t.value(model.dt))
        result = process.advance(t, model, process.given(t, model, step), step)
        for i in range(n):
            t.store("out.x", i, result.x[i])
            for j in range(n):
                total_ = result.Q[i][j]
                for w, d in result.noise:
                    total_ = total_ + w[i] * d * w[j]
                t.store("out.Q", i * n + j, t.value(total_))
        return Function(f"step_{b}", [], schedule(t), "", returns="void")

    def _sensor(self, model: Model, b: int, k: int) -> Function:
        t = Trace()
        sensor = model.sensors[k]
        code = SensorCode(t, model, sensor, list(range(self.n)))
        linear = code.linearise(code.prior())
        R, m = total(linear), len(sensor.h)
        for i in range(m):
            t.store("out.z", i, linear.predicted[i].value)
            for j in range(m):
                t.store("out.R", i * m + j, t.value(R[i][j]))
        return Function(f"see_{b}_{k}", [], schedule(t), "", returns="void")

    def log(self, rows: int, random: Random, reading: Random, first: int = 0) -> tuple[dict[str, list[float]], int]:
        """Columns, and how many rows there are: fewer than asked for where the model leaves the numbers.

        random: for the truth; reading: for the noise of the sensors; first: the mode to begin with.
        """
        model, n = self.model, self.n
        memory = Memory({"kf.x": [], "out.x": [0.0] * n, "out.Q": [0.0] * n * n}, {"kf.steps": 0, "kf.t": 0.0})
        x = [float(v) for v in model.x0]
        P0 = [[float(v) for v in row] for row in model.P0]
        self._place(memory, x, draw(P0, random))
        for name, number in model.parameters:
            memory.numbers[f"kf.parameters.{name}"] = float(number)
        names = [c for s in model.sensors for c in self._names(s)]
        columns: dict[str, list[float]] = {c: [] for c in ("t", *model.inputs, *names)}
        inputs = [self._input(i, random) for i in range(len(model.inputs))]
        nominal = declared.number(self.spec.dt.nominal, self.spec) if self.spec.dt is not None else 1.0
        now, k, mode, left = 0.0, 0, first, self._dwell(random)
        for k in range(rows):
            if left == 0:
                mode, left = (mode + 1) % len(self.models), self._dwell(random)
            left -= 1
            for name, (middle, amplitude, waves) in zip(model.inputs, inputs, strict=True):
                drive = sum(math.sin(2 * math.pi * k / period + phase) for period, phase in waves) / len(waves)
                memory.numbers[f"u.{name}"] = middle + amplitude * drive
            if k or not self.run_time:
                dt = self._clamped(nominal * (1 + JITTER * (2 * random.random() - 1))) if self.run_time else nominal
                memory.numbers["dt"] = dt
                self.program.run(f"step_{mode}", memory)
                after = list(memory.arrays["out.x"])
                self.last = flat = memory.arrays["out.Q"]
                noise = draw([flat[i * n : i * n + n] for i in range(n)], random)
                if not all(abs(a) < HUGE for a in after):
                    return columns, k
                self._place(memory, after, noise)
                now += dt
                memory.numbers["kf.t"] = now
                memory.numbers["kf.steps"] += 1
            columns["t"].append(now)
            for name in model.inputs:
                columns[name].append(memory.numbers[f"u.{name}"])
            for i, sensor in enumerate(model.sensors):
                m = len(sensor.h)
                memory.arrays["out.z"], memory.arrays["out.R"] = [0.0] * m, [0.0] * (m * m)
                self.program.run(f"see_{mode}_{i}", memory)
                flat = memory.arrays["out.R"]
                noise = draw([flat[r * m : r * m + m] for r in range(m)], reading)
                for name, z, e, period in zip(self._names(sensor), memory.arrays["out.z"], noise, sensor.periods,
                                              strict=True):  # fmt: skip
                    z += e
                    columns[name].append(z if period is None else math.remainder(z, float(period)))
        return columns, rows

    def _dwell(self, random: Random) -> int:
        """Rows for which the truth keeps its mode; those of a filter by itself are without end."""
        return -1 if len(self.models) == 1 else 1 + int(2 * DWELL * random.random())

    def process_noise(self) -> list[list[float]]:
        """The variance that a step of each mode adds to each state (modes, n), at the initial state."""
        out = []
        for first in range(len(self.models)):
            self.log(1 + self.run_time, Random(1), Random(2), first)
            out.append([max(self.last[i * self.n + i], 0.0) for i in range(self.n)])
        return out

    def _names(self, sensor: SensorModel) -> list[str]:
        return [f"{sensor.name}.{c.name}" for c in sensor.spec.components]

    def _place(self, memory: Memory, x: Sequence[float], noise: Sequence[float]) -> None:
        placed = []
        for a, e, limits, period in zip(x, noise, self.limits, self.model.periods, strict=True):
            v = a + e if limits is None else min(max(a + e, limits[0]), limits[1])
            placed.append(v if period is None else math.remainder(v, float(period)))
        memory.arrays["kf.x"] = placed

    def _limits(self, i: int) -> tuple[float, float] | None:
        """What a state stays within: its bounds, or the range that it is declared to have."""
        bounds, given = self.model.bounds[i], self.spec.states[i].range
        if bounds is not None:
            return float(bounds[0]), float(bounds[1])
        return None if given is None else declared.limits(given, self.spec)

    def _clamped(self, dt: float) -> float:
        low, high = self.model.dt_limits
        dt = dt if low is None else max(dt, float(low))
        return dt if high is None else min(dt, float(high))

    def _input(self, i: int, random: Random) -> tuple[float, float, list[tuple[float, float]]]:
        """The middle of an input, the size of its swing, and three periods (in steps) with their phases."""
        each = self.spec.inputs[i]
        middle, amplitude = 0.0, 1.0
        if each.range is not None:
            low, high = declared.limits(each.range, self.spec)
            middle, amplitude = (low + high) / 2, (high - low) / 8
        waves = [(25.0 * 10 ** random.random(), 2 * math.pi * random.random()) for _ in range(3)]
        return middle, amplitude, waves


def draw(P: list[list[float]], random: Random) -> list[float]:
    """A draw from N(0, P), by its lower root; what is not positive has no spread."""
    n = len(P)
    S = [[0.0] * n for _ in range(n)]
    for j in range(n):
        pivot = P[j][j] - sum(S[j][k] ** 2 for k in range(j))
        S[j][j] = math.sqrt(pivot) if pivot > 1e-12 * abs(P[j][j]) else 0.0
        for i in range(j + 1, n):
            if S[j][j] > 0:
                S[i][j] = (P[i][j] - sum(S[i][k] * S[j][k] for k in range(j))) / S[j][j]
    numbers = random.standard_normal(n)
    return [sum(S[i][k] * float(numbers[k]) for k in range(i + 1)) for i in range(n)]
