"""What the functions of a filter work on while it runs in Python."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from kfgen.filters.base import FilterCode


@dataclass
class Memory:
    """What functions work on: `kf.x` -> list; `kf.nis`, `u.gyro`, `z.x`, `dt` -> number."""

    arrays: dict[str, list[Any]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> Memory:
        return Memory({k: list(v) for k, v in self.arrays.items()}, dict(self.numbers))


def blank(code: FilterCode) -> Memory:
    """The filter's fields, and the arguments that its functions may be given, all zero."""
    memory = Memory()
    for block in code.blocks:
        if block.size is None:
            memory.numbers[f"kf.{block.name}"] = {"real": 0.0, "uint32": 0, "bool": False}[block.kind]
        else:
            memory.arrays[f"kf.{block.name}"] = [0.0] * block.size
    spec = code.model.spec
    memory.numbers |= {f"u.{each.name}": 0.0 for each in spec.inputs}
    memory.numbers |= {f"z.{c.name}": 0.0 for sensor in spec.measurements for c in sensor.fields}
    n = len(code.model.states)
    for f in code.functions:
        for a in f.arguments:
            if a.size is not None and not f.private:
                size = max(a.size, n, len(memory.arrays.get(a.name, ())))  # that of the largest sensor
                memory.arrays[a.name] = [0.0] * size
    return memory
