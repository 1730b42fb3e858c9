"""The run that a self-test replays: short, plausible, and the same numbers on every machine."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from kfgen.simulate import simulate
from kfgen.spec.sensors import columns_of
from kfgen.spec.types import Spec

Array = NDArray[np.float64]

NUMBERS = 600
"""How many recorded numbers are aimed at: flash of the smallest targets is short."""
STEPS = range(6, 25)


class Dice:
    """Random numbers that do not depend on a library's version or a machine's libm."""

    def __init__(self, seed: str) -> None:
        self._seed = seed
        self._count = 0

    def random(self) -> float:
        """In [0, 1), of 32 bits."""
        self._count += 1
        digest = sha256(f"{self._seed} {self._count}".encode()).digest()
        return int.from_bytes(digest[:4], "little") / 2**32

    def uniform(self, low: float, high: float, size: int) -> Array:
        return np.array([low + (high - low) * self.random() for _ in range(size)])

    def standard_normal(self, size: int) -> Array:
        """Nearly normal, the sum of four uniform numbers, never beyond 3.5: no gate is near."""
        spread = (12 / 4) ** 0.5
        return np.array([spread * (sum(self.random() for _ in range(4)) - 2) for _ in range(size)])

    def choice(self, a: int, *, p: Array) -> int:
        left = self.random()
        for i in range(a - 1):
            left -= float(p[i])
            if left < 0:
                return i
        return a - 1


@dataclass(frozen=True)
class Track:
    """k steps: u [k, inputs], dt [k] s, z [k, components and own inputs of all sensors]; sensor i measures in each
    (i+1)-th."""

    u: Array
    dt: Array
    z: Array

    def first(self, steps: int) -> Track:
        return Track(self.u[:steps], self.dt[:steps], self.z[:steps])


def track_of(spec: Spec) -> Track:
    """A track drawn from the model, of numbers that a float carries."""
    n, m = len(spec.states), sum(len(sensor.fields) for sensor in spec.measurements)
    steps = min(max(NUMBERS // (2 * n + m + len(spec.inputs)), STEPS.start), STEPS.stop - 1)
    # one row more: a run-time dt begins with the second
    log = simulate(spec, steps + 1, draws=Dice(spec.name))
    columns = {name: column[1:] for name, column in log.columns.items()}
    run_time = spec.dt is not None and spec.dt.run_time
    dt = np.diff(log.columns["t"]) if run_time else np.zeros(steps)
    names = [name for sensor in spec.measurements for name in columns_of(sensor)]
    z = np.column_stack([columns[name] for name in names])
    u = np.column_stack([columns[each.name] for each in spec.inputs]) if spec.inputs else np.empty((steps, 0))
    return Track(_single(u), _single(dt), _single(z))


def _single(values: Array) -> Array:
    rounded: Array = values.astype(np.float32).astype(np.float64)
    return rounded
