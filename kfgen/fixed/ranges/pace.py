"""How little a step changes: whether a cell needs digits below its LSB.

A nominal run is looked at now and then in its second half. A step of the filter adds g to a variance P, the updates
between two steps take d from it. Where g < d the filter has not settled yet; as what an update takes is in proportion
to P^2, it will settle near P sqrt(g / d), and then takes g as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median

from kfgen.filters.base import FilterCode
from kfgen.fixed.ranges.memory import Memory
from kfgen.fixed.ranges.real import RealProgram

EVERY = 8  # rows between two looks
GRAIN = 256.0  # LSBs of a variance that a step has to add, or its rounding is felt
DRIFT = 0.01  # standard deviations that the rounding of a state may shift it by
FASTEST = 1 / 64  # by which a standard deviation is brought nearer at once
SETTLED = 0.9
NEVER = 1e-12  # of a variance: not changed


@dataclass
class Pace:
    """What the steps of a run changed. Give `look` to a run as its watcher."""

    code: FilterCode
    program: RealProgram
    before: list[list[float]] = field(default_factory=list)  # P_ii
    grown: list[list[float]] = field(default_factory=list)  # by the step
    left: list[list[float]] = field(default_factory=list)  # P_ii before the next one
    moved: dict[str, list[list[float]]] = field(default_factory=dict)  # block -> sizes of its elements' changes

    def __post_init__(self) -> None:
        names = {f.name for f in self.code.functions}
        self.known = "get_covariance" in names and not self.code.modes
        self.fields = [f"kf.{b.name}" for b in self.code.blocks if b.name in ("D", "P")]

    def look(self, k: int, rows: int, memory: Memory, step: Callable[[], object]) -> None:
        """Make step k of `rows`, by calling `step`, and see what it changes."""
        place = k % EVERY
        if not self.known or 2 * k < rows or place > 1:
            step()
            return
        P = self._variances(memory)
        if place == 1:
            if len(self.left) < len(self.before):
                self.left.append(P)
            step()
            return
        old = {name: list(memory.arrays[name]) for name in self.fields}
        step()
        if len(self.left) == len(self.before):
            self.before.append(P)
            self.grown.append([b - a for a, b in zip(P, self._variances(memory), strict=True)])
            for name, values in old.items():
                changes = [abs(b - a) for a, b in zip(values, memory.arrays[name], strict=True)]
                self.moved.setdefault(name, []).append(changes)

    def _variances(self, memory: Memory) -> list[float]:
        return self.program.variances(memory, len(self.code.model.errors))

    def typical(self) -> list[float]:
        """The variances of the run; none where they were not looked at."""
        return [median(variances) for variances in zip(*self.before, strict=True)]

    def factors(self) -> list[float] | None:
        """By what to multiply the standard deviations to come near to where they settle; None where they are there."""
        if not self.left:
            return None
        out = []
        for i, variances in enumerate(zip(*self.before, strict=True)):
            found = self._settling(i)
            P = median(variances)
            out.append(1.0 if found is None or not P > 0 else max((found[0] / P) ** 0.5, FASTEST))
        return out if min(out) < SETTLED else None

    def drifts(self, i: int, lsb: float) -> bool:
        """Whether rounding state i to its LSB in every step would shift it."""
        found = self._settling(i)
        if found is None:
            return False
        P, g = found
        return 0.5 * lsb * math.sqrt(P) > DRIFT * g

    def crawls(self, block: str, index: int, i: int | None, lsb: float) -> bool:
        """Whether a step changes an element of D or P by too little for its LSB. i: the state of a variance."""
        if not self.moved:
            return False
        found = None if i is None else self._settling(i)
        slowest = median(row[index] for row in self.moved[block])
        return min(slowest, slowest if found is None else found[1]) < GRAIN * lsb

    def _settling(self, i: int) -> tuple[float, float] | None:
        """Where P_ii settles and what a step adds to it; None where dynamics hold it, or nothing tells of state i."""
        if not self.left:
            return None
        P, g = median(row[i] for row in self.before), median(row[i] for row in self.grown)
        d = median(a[i] + b[i] - c[i] for a, b, c in zip(self.before, self.grown, self.left, strict=False))
        if g < -NEVER * P or not d > NEVER * P > 0:
            return None
        return P * min(1.0, (max(g, 0.0) / d) ** 0.5), max(g, NEVER * P)
