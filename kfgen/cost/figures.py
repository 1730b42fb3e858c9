"""What a measurement gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class FunctionCost:
    """One emitted function.

    counts: instructions (or cycles) of each call, library functions included. flash: bytes of its own code.
    stack: bytes below its caller's, at the deepest. cycles: an estimate for the mean call.
    """

    counts: tuple[int, ...]
    flash: int
    stack: int
    cycles: float | None = None

    @property
    def mean(self) -> float | None:
        return sum(self.counts) / len(self.counts) if self.counts else None

    @property
    def worst(self) -> int | None:
        return max(self.counts, default=None)


@dataclass(frozen=True)
class Cost:
    """A filter on a target.

    functions: predict, and the updates. flash: bytes of code and constants that init, predict and the updates take,
    with what the filter's functions share; a masked update counts only in `functions`. flash_linked: with the parts of
    libm and of the compiler's library that they pull in. ram: bytes of the struct, and of what else the filter keeps
    in RAM. unit: what is counted, `instructions` or `cycles`. errors: calls that the filter refused.
    """

    name: str
    scalar: str
    target: str
    compiler: str
    flags: tuple[str, ...]
    unit: str
    functions: Mapping[str, FunctionCost]
    flash: int
    flash_linked: int
    ram: int
    errors: int
    remark: str = ""  # what the reader of the figures should know
    shared: int = 0  # bytes of `flash` that are init's, or not of one function
    init_stack: int = 0

    @property
    def stack(self) -> int:
        """The deepest of all functions that were called."""
        return max([self.init_stack, *(each.stack for each in self.functions.values())])

    @property
    def step(self) -> float:
        """One call of each function that was called, the mean."""
        return sum(each.mean for each in self.functions.values() if each.mean is not None)

    @property
    def instructions(self) -> dict[str, tuple[int, ...]]:
        """Function -> the count of each call."""
        return {name: each.counts for name, each in self.functions.items()}

    def as_json(self, mhz: float | None = None) -> dict[str, Any]:
        """Plain data; `microseconds` is an estimate."""
        functions = {}
        for name, each in self.functions.items():
            functions[name] = {
                "calls": len(each.counts), "mean": each.mean, "worst": each.worst, "flash": each.flash,
                "stack": each.stack, "cycles_estimate": each.cycles,
            }  # fmt: skip
            if mhz is not None:
                time = None if each.cycles is None else each.cycles / mhz
                functions[name]["microseconds_estimate"] = time
        plain = {key: value for key, value in asdict(self).items() if key not in ("functions", "init_stack", "shared")}
        return {**plain, "stack": self.stack, "step": self.step, "functions": functions}
