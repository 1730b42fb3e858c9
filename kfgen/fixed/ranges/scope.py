"""The objects that generated source refers to, by name: no text of a spec enters it."""

from __future__ import annotations

import math
from typing import Any

from kfgen.fixed.ranges.functions import FUNCTIONS
from kfgen.fixed.ranges.ranges import HUGE, Ranges
from kfgen.ir.nodes import Table


class Scope:
    """Name -> object, for the functions of one program. extra: further ones."""

    def __init__(self, ranges: Ranges, extra: dict[str, Any] | None = None) -> None:
        self.names: dict[str, Any] = {
            **FUNCTIONS, "H": ranges.high, "L": ranges.low, "S": ranges.small, "BIG": HUGE, "inf": math.inf,
            **(extra or {}),
        }  # fmt: skip

    def bound(self, value: object) -> str:
        """A name for an object."""
        name = f"bound_{len(self.names)}"
        self.names[name] = value
        return name

    def table(self, table: Table) -> str:
        """A name for a table; with _x, _s, _y, _d after it, for its numbers as floats."""
        for known, value in self.names.items():
            if value is table:
                return known
        name = f"table_{len(self.names)}"
        self.names[name] = table
        self.names[f"{name}_x"] = [float(v) for v in table.x]
        self.names[f"{name}_s"] = [float(v) for v in table.starts()]
        self.names[f"{name}_y"] = [float(v) for v in table.values()]
        self.names[f"{name}_d"] = [float(v) for v in table.slopes()]
        return name
