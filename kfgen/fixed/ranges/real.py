"""The real program as Python functions on floats that record the largest values met: where binary points come from.

Every operation is a statement of generated Python source, so that a run of a few hundred steps takes a fraction of
a second. The source is made of the program alone; no text of a spec enters it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.ranges.source import Source
from kfgen.ir.nodes import Table
from kfgen.ir.program import Function

__all__ = ["HUGE", "Memory", "Ranges", "RealProgram", "Source"]

HUGE = 1e30  # what is beyond has left the model


@dataclass
class Ranges:
    """high, low: the largest and smallest value (at least 0, at most 0); small: the smallest size that is not 0."""

    index: dict[Any, int] = field(default_factory=dict)
    high: list[float] = field(default_factory=list)
    low: list[float] = field(default_factory=list)
    small: list[float] = field(default_factory=list)
    quotients: dict[tuple[str, str], list[float]] = field(default_factory=dict)  # function, local -> all its values

    def slot(self, key: Any) -> int:
        """The place of a cell or of a node."""
        found = self.index.get(key)
        if found is None:
            found = self.index[key] = len(self.high)
            self.high.append(0.0)
            self.low.append(0.0)
            self.small.append(HUGE)
        return found

    def see(self, key: Any, value: float) -> None:
        i = self.slot(key)
        if math.isfinite(value):
            self.high[i] = max(self.high[i], value)
            self.low[i] = min(self.low[i], value)

    def copy(self) -> tuple[list[float], ...]:
        """What has been met so far; for `restore`."""
        return list(self.high), list(self.low), list(self.small)

    def restore(self, seen: tuple[list[float], ...]) -> None:
        """Forget what has been met since."""
        for values, old, blank in zip((self.high, self.low, self.small), seen, (0.0, 0.0, HUGE), strict=True):
            values[:] = old + [blank] * (len(values) - len(old))

    def largest(self, key: Any) -> float:
        """The largest size met, 0 where nothing was."""
        i = self.index.get(key)
        return 0.0 if i is None else max(self.high[i], -self.low[i])

    def spread(self, function: str, name: str) -> float:
        """By how much the largest size of a quotient exceeds its usual one; 0 where it was never made."""
        sizes = sorted(abs(v) for v in self.quotients.get((function, name), []) if v and math.isfinite(v))
        return sizes[-1] / sizes[len(sizes) // 2] if sizes else 0.0

    def smallest(self, key: Any) -> float:
        i = self.index.get(key)
        return 0.0 if i is None or self.small[i] >= HUGE else self.small[i]


@dataclass
class Memory:
    """What functions work on: `kf.x` -> list; `kf.nis`, `u.gyro`, `z.x`, `dt` -> number."""

    arrays: dict[str, list[Any]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> Memory:
        return Memory({k: list(v) for k, v in self.arrays.items()}, dict(self.numbers))


class RealProgram:
    """The functions of a filter, to be run on a Memory."""

    def __init__(self, functions: list[Function], arrays: Arrays, ranges: Ranges,
                 source: type[Source] | None = None, scope: dict[str, Any] | None = None) -> None:  # fmt: skip
        self.ranges = ranges
        self.arrays = arrays
        self._scope: dict[str, Any] = {
            **_FUNCTIONS, "H": ranges.high, "L": ranges.low, "S": ranges.small, "BIG": HUGE, "inf": math.inf,
            **(scope or {}),
        }  # fmt: skip
        for f in functions:
            text = (source or Source)(f, self).text()
            exec(compile(text, f"<{f.name}>", "exec"), self._scope)

    def table(self, table: Table) -> str:
        name = f"table_{len(self._scope)}"
        for known, value in self._scope.items():
            if value is table:
                return known
        self._scope[name] = table
        self._scope[f"{name}_x"] = [float(v) for v in table.x]
        self._scope[f"{name}_s"] = [float(v) for v in table.starts()]
        self._scope[f"{name}_y"] = [float(v) for v in table.values()]
        self._scope[f"{name}_d"] = [float(v) for v in table.slopes()]
        return name

    def bound(self, value: object) -> str:
        """A name for an object, as the source may use it."""
        name = f"bound_{len(self._scope)}"
        self._scope[name] = value
        return name

    def constants(self, numbers: tuple[Any, ...]) -> str:
        return self.bound([float(v) for v in numbers])

    def data(self, data: object) -> str:
        """What an operation holds beside its arguments, as the source may use it."""
        return self.bound(data)

    def numbers(self, numbers: tuple[Any, ...]) -> str:
        """A table of constants."""
        return self.constants(numbers)

    def run(self, function: str, memory: Memory) -> str:
        """Run a function; the name of the status with which it ended."""
        result: str = self._scope[f"f_{function}"](memory.arrays, memory.numbers)
        return result


def _safe(function: Callable[..., float]) -> Callable[..., float]:
    def call(*args: float) -> float:
        try:
            return function(*args)
        except (ValueError, OverflowError, ZeroDivisionError):
            return math.nan

    return call


def _div(a: float, b: float) -> float:
    if b == 0:
        return math.nan if a == 0 or a != a else math.copysign(math.inf, a)
    return a / b


def _wrap(a: float, period: float) -> float:
    half = period / 2
    if math.isfinite(a) and (a > half or a <= -half):
        a -= period * math.ceil((a - half) / period)
    return a


def _segment(a: float, points: list[float]) -> int:
    return sum(1 for p in points if p <= a)


_FUNCTIONS: dict[str, Any] = {
    "q_div": _div,
    "wrap": _wrap,
    "segment": _segment,
    "q_abs": abs,
    "q_min": lambda a, b: b if b < a else a,
    "q_max": lambda a, b: b if b > a else a,
    "q_sign": lambda a: float((a > 0) - (a < 0)),
    "q_floor": _safe(lambda a: float(math.floor(a))),
    "q_pow": _safe(lambda a, b: float(math.pow(a, b))),
    **{f"q_{name}": _safe(getattr(math, name)) for name in (
        "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "atan2")},
}  # fmt: skip
