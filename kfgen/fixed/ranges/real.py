"""The real program as Python functions on floats that record what they meet: where binary points come from.

Every operation is a statement of generated Python source, so that a run of a few hundred steps takes a fraction of
a second. The source is made of the program alone; no text of a spec enters it.
"""

from __future__ import annotations

from typing import Any

from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.ranges.memory import Memory
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.scope import Scope
from kfgen.fixed.ranges.source import Source
from kfgen.ir.program import Function


class RealProgram:
    """The functions of a filter, to be run on a Memory. source: how numbers are computed; extra: names it uses."""

    def __init__(self, functions: list[Function], arrays: Arrays, ranges: Ranges,
                 source: type[Source] = Source, extra: dict[str, Any] | None = None) -> None:  # fmt: skip
        self.ranges = ranges
        self.arrays = arrays
        scope = Scope(ranges, extra)
        for f in functions:
            text = source(f, arrays, ranges, scope).text()
            exec(compile(text, f"<{f.name}>", "exec"), scope.names)
        self._names = scope.names

    def run(self, function: str, memory: Memory) -> str:
        """Run a function; the name of the status with which it ended."""
        result: str = self._names[f"f_{function}"](memory.arrays, memory.numbers)
        return result

    def variances(self, memory: Memory, n: int) -> list[float]:
        """P_ii of n states. KeyError where the filter does not say."""
        other = memory.copy()
        self.run("get_covariance", other)
        return other.arrays["P"][: n * n : n + 1]
