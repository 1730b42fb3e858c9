"""The truth of a filter's model: stepped by f with drawn noise, seen by its sensors as the filter sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from kfgen.filters.base import FilterCode
from kfgen.filters.steps import process
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.sensor import SensorCode, total
from kfgen.fixed.program.cells import find_arrays
from kfgen.fixed.ranges.box import Box
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.memory import Memory
from kfgen.fixed.ranges.ranges import HUGE, Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.model import Model


class Truth:
    """The programs of a filter's models, or of those of a bank's modes, and a memory that they work on.

    All noises are added as the filter sees them, linearised at the truth. States stay within the box.
    """

    def __init__(self, code: FilterCode, box: Box) -> None:
        self.model = model = code.model
        self.models = [mode.model for mode in code.modes] or [model]
        self.box = box
        self.nx, self.n = len(model.states), len(model.errors)
        self.run_time = model.spec.dt is not None and model.spec.dt.run_time
        functions = []
        for b, mode in enumerate(self.models):
            functions += [self._step(mode, b), *(self._sensor(mode, b, k) for k in range(len(model.sensors)))]
        self.program = RealProgram(functions, find_arrays(functions), Ranges())
        self.last = [0.0] * self.n**2  # Q of the last step
        self.memory = Memory()
        self.now = 0.0
        self.space = model.space
        self.cut = [0.0] * self.nx  # by how much the last step would have left the box

    def _step(self, model: Model, b: int) -> Function:
        t, n = Trace(), self.n
        step = Step(t.field("dt") if self.run_time else None if model.dt is None else t.value(model.dt))
        result = process.advance(t, model, process.given(t, model, step), step)
        for i, value in enumerate(result.x):
            t.store("out.x", i, value)
        for i in range(n):
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
        R, m = total(linear), sensor.dimension
        for i, value in enumerate(code.predicted(code.prior())):
            t.store("out.z", i, value)
        for i in range(m):
            for j in range(m):
                t.store("out.R", i * m + j, t.value(R[i][j]))
        return Function(f"see_{b}_{k}", [], schedule(t), "", returns="void")

    @property
    def x(self) -> list[float]:
        return self.memory.arrays["kf.x"]

    def begin(self, random: Random) -> None:
        """At a draw of the first estimate, with the spec's parameters, at time 0."""
        model, n = self.model, self.n
        arrays = {"kf.x": [], "out.x": [0.0] * self.nx, "out.Q": [0.0] * n * n}
        self.memory = Memory(arrays, {"kf.steps": 0, "kf.t": 0.0})
        for sensor in model.sensors:  # of a quaternion that is tested, though what is measured is yet to be drawn
            self.memory.numbers |= {f"z.{part}": 1.0 for r in sensor.rotations for part in r.parts}
        self.now = 0.0
        for name, number in model.parameters:
            self.memory.numbers[f"kf.parameters.{name}"] = float(number)
        P0 = [[float(v) for v in row] for row in model.P0]
        self.place([float(v) for v in model.x0], draw(P0, random))

    def place(self, x: Sequence[float], noise: Sequence[float]) -> None:
        """Put the truth at x [+] noise, or as near to it as the box allows."""
        wanted = list(x)
        for i, j, _ in self.space.singles:
            wanted[i] = x[i] + noise[j]
        for i, j, rotation in self.space.rotations:
            wanted[i : i + 4] = rotation.retract(x[i : i + 4], noise[j : j + 3])
        inside = list(wanted)
        for i, _, part in self.space.singles:
            inside[i] = self.box.inside(i, wanted[i]) if part.flat else wanted[i]
        self.cut = [a - b for a, b in zip(wanted, inside, strict=True)]
        self.memory.arrays["kf.x"] = self.space.placed(inside)

    def step(self, mode: int, dt: float, random: Random) -> bool:
        """One step; False where the model leaves the numbers, and the truth stays where it is."""
        memory, n = self.memory, self.n
        memory.numbers["dt"] = dt
        self.program.run(f"step_{mode}", memory)
        after = list(memory.arrays["out.x"])
        self.last = flat = memory.arrays["out.Q"]
        noise = draw([flat[i * n : i * n + n] for i in range(n)], random)
        if not all(abs(a) < HUGE for a in after):
            return False
        self.place(after, noise)
        self.now += dt
        memory.numbers["kf.t"] = self.now
        memory.numbers["kf.steps"] += 1
        return True

    def see(self, mode: int, k: int, random: Random, given: Sequence[float] = ()) -> list[float]:
        """A reading of sensor k (m,). given: the sensor's own inputs."""
        sensor = self.model.sensors[k]
        self.memory.numbers.update({f"z.{name}": value for name, value in zip(sensor.inputs, given, strict=True)})
        m = sensor.dimension
        arrays = self.memory.arrays
        arrays["out.z"], arrays["out.R"] = [0.0] * len(sensor.h), [0.0] * (m * m)
        self.program.run(f"see_{mode}_{k}", self.memory)
        flat = arrays["out.R"]
        noise = draw([flat[r * m : r * m + m] for r in range(m)], random)
        z = list(arrays["out.z"])
        for i, j, part in sensor.space.singles:
            z[i] = part.placed(z[i] + noise[j])
        for i, j, rotation in sensor.space.rotations:
            z[i : i + 4] = rotation.retract(rotation.normalised(z[i : i + 4]), noise[j : j + 3])
        return z


def draw(P: list[list[float]], random: Random) -> list[float]:
    """A draw from N(0, P), by its lower root; what is not positive has no spread."""
    n = len(P)
    if not any(P[i][j] for i in range(n) for j in range(i)):  # for the speed
        pairs = zip(random.standard_normal(n), (P[i][i] for i in range(n)), strict=True)
        return [math.sqrt(variance) * number if variance > 0 else 0.0 for number, variance in pairs]
    S = [[0.0] * n for _ in range(n)]
    for j in range(n):
        pivot = P[j][j] - sum(S[j][k] ** 2 for k in range(j))
        S[j][j] = math.sqrt(pivot) if pivot > 1e-12 * abs(P[j][j]) else 0.0
        for i in range(j + 1, n):
            if S[j][j] > 0:
                S[i][j] = (P[i][j] - sum(S[i][k] * S[j][k] for k in range(j))) / S[j][j]
    numbers = random.standard_normal(n)
    return [sum(S[i][k] * float(numbers[k]) for k in range(i + 1)) for i in range(n)]
