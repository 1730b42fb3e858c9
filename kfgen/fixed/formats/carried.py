"""Which cells need digits below their LSB: those that a step changes by less than can be rounded away."""

from __future__ import annotations

import math

from kfgen.filters.base import FilterCode
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.program.cells import Cell, packed
from kfgen.fixed.program.chains import chained
from kfgen.fixed.ranges.pace import Pace

CARRIED = 16  # bits below the LSB that a carried cell has


def carry(code: FilterCode, formats: Formats, pace: Pace) -> None:
    """Find the cells of one filter that change by less than can be rounded away."""
    arrays, states, errors = formats.arrays, code.model.states, code.model.errors

    def mark(cell: Cell, name: str) -> None:
        if chained(code.functions, arrays, cell):
            formats.carried[cell] = len(formats.carried)
            for q in formats.report:
                if q.name == name:
                    q.raised = f"{q.raised}, rounding carried on".removeprefix(", ")

    for i in range(len(states)):
        cell = arrays.state(i)
        error = code.model.space.errors_of[i]
        if error is not None and pace.drifts(error, math.ldexp(1.0, formats.fixed[cell])):
            mark(cell, states[i])
    if not pace.moved:
        return
    name = "D" if "kf.D" in pace.moved else "P"
    slow: set[int] = set()
    for diagonal in (True, False) if name == "P" else (True,):  # beside a slow variance, correlations may be slow
        for j in range(len(errors)):
            for i in (j,) if diagonal else range(j):
                index = j if name == "D" else packed(i, j)
                cell = arrays.element(("array", f"kf.{name}"), index)
                e = formats.of(cell)
                if e is None or not (diagonal or {i, j} & slow):
                    continue
                if pace.crawls(f"kf.{name}", index, code.order[j] if diagonal else None, math.ldexp(1.0, e)):
                    slow |= {j} if diagonal else set()
                    mark(cell, f"{name}[{errors[code.order[j]]}]" if diagonal else "")
