"""The search for the best numbers: coordinates in which they are alike, and the way to the top."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import minimize

from kfgen.errors import KfgenError
from kfgen.tuning.numbers import Slot
from kfgen.tuning.objective import Array, Objective, Score

FAR = math.log(1e6)  # how far a positive number may go from where it was, in its logarithm
STEP, ROUGH_STEP = 2e-3, 0.03  # of the gradient's differences, in the coordinates; where gates make jumps
LOOSE = math.log(10.0)  # a standard error of a logarithm beyond this tells nothing

Advance = Callable[[int, str], None]


@dataclass(frozen=True)
class Coordinates:
    """Numbers as the search sees them: logarithms of positive ones, others in a unit that matters."""

    slots: Sequence[Slot]
    units: Array

    def numbers(self, at: Array) -> list[float]:
        out = []
        for slot, unit, t in zip(self.slots, self.units, at.tolist(), strict=True):
            number = slot.value * math.exp(t) if slot.positive else slot.value + unit * t
            out.append(min(max(number, slot.limits[0]), slot.limits[1]))
        return out

    def bounds(self) -> list[tuple[float | None, float | None]]:
        found: list[tuple[float | None, float | None]] = []
        for slot, unit in zip(self.slots, self.units, strict=True):
            low, high = slot.limits
            if slot.positive:
                found.append((max(-FAR, math.log(low / slot.value)) if low > 0 else -FAR,
                              min(FAR, math.log(high / slot.value)) if high < math.inf else FAR))  # fmt: skip
            else:
                found.append((None if low == -math.inf else (low - slot.value) / unit,
                              None if high == math.inf else (high - slot.value) / unit))  # fmt: skip
        return found

    def slope(self, at: Array) -> Array:
        """d number / d coordinate at numbers `at`."""
        pairs = zip(self.slots, self.units, at.tolist(), strict=True)
        return np.array([number if slot.positive else unit for slot, unit, number in pairs])


@dataclass
class Search:
    """Where a search has come to. interrupted: by Ctrl-C, before its end."""

    objective: Objective
    coordinates: Coordinates
    advance: Advance = lambda done, what: None
    best: Array = field(default_factory=lambda: np.zeros(0))
    height: float = -math.inf
    interrupted: bool = False

    @property
    def uneven(self) -> bool:
        """Whether a small change may make a jump."""
        return any(sensor.gate is not None for sensor in self.objective.spec.measurements)

    def heights(self, trials: Sequence[Array]) -> Array:
        scores = self.objective.scores([self.coordinates.numbers(trial) for trial in trials])
        heights = np.array([self.objective.value(score) for score in scores])
        heights = np.where(np.isfinite(heights), heights, -1e300)
        for trial, height in zip(trials, heights.tolist(), strict=True):
            if height > self.height:
                self.best, self.height = np.array(trial), height
        self.advance(self.objective.trials, "tuning")
        return heights

    def climb(self) -> None:
        """To the top, by L-BFGS-B on differences; then by a simplex where gates make the ground uneven."""
        k = len(self.coordinates.slots)
        bounds = self.coordinates.bounds()
        try:
            self.heights([self.best if self.best.size else np.zeros(k)])
            for _ in range(4):
                before = self.height
                minimize(self._slope, self.best, jac=True, method="L-BFGS-B", bounds=bounds,
                         options={"maxiter": 100, "ftol": 1e-10, "gtol": 1e-3, "maxls": 30})  # fmt: skip
                if self.height - before < 0.01:
                    break
            if self.uneven and k <= 8:
                simplex = np.vstack([self.best, self.best + 0.2 * np.eye(k)])
                options: Any = {"initial_simplex": simplex, "maxfev": 60 * k, "fatol": 0.01, "xatol": 1e-3}
                minimize(self._depth, self.best, method="Nelder-Mead", bounds=bounds, options=options)
        except KeyboardInterrupt:
            self.interrupted = True

    def _depth(self, at: Array) -> float:
        return -float(self.heights([at])[0])

    def _slope(self, at: Array) -> tuple[float, Array]:
        step = ROUGH_STEP if self.uneven else STEP
        moved = [at + sign * step * row for row in np.eye(len(at)) for sign in (1.0, -1.0)]
        heights = self.heights([at, *moved])
        slope = (heights[1::2] - heights[2::2]) / (2 * step)
        return -float(heights[0]), -slope


def units_of(objective: Objective, slots: Sequence[Slot]) -> Array:
    """By how much each number that is not positive has to change to matter; 1 for the others, which are logarithms.

    KfgenError for a number that changes nothing at all.
    """
    start = [slot.value for slot in slots]
    base = objective.scores([start])[0]
    units, idle = np.ones(len(slots)), []
    for i, slot in enumerate(slots):
        step = 0.5 if slot.positive else _first_step(slot)
        for _ in range(24):
            trial = list(start)
            trial[i] = slot.value * math.exp(step) if slot.positive else slot.value + step
            score = objective.scores([trial])[0]
            if slot.positive or abs(objective.value(score) - objective.value(base)) > 0.1:
                break
            step *= 4.0
        if _same(score, base):
            idle.append(slot.path)
        units[i] = 1.0 if slot.positive else step
    if idle:
        where = "this log" if len(objective.drives) == 1 else "these logs"
        listed = ", ".join(idle)
        raise KfgenError(f"{listed} changes nothing on {where}: no measurement depends on it; leave it out of --free")
    return units


def _first_step(slot: Slot) -> float:
    low, high = slot.limits
    width = high - low if math.isfinite(high - low) else abs(slot.value) or 1.0
    return 1e-4 * width


def _same(a: Score, b: Score) -> bool:
    return a.likelihood == b.likelihood and a.error == b.error
