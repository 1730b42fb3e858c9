"""Binary points of P or D inside: head-room above the runs, which gives way to the process noise of a step."""

from __future__ import annotations

import math

from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic.limits import BITS
from kfgen.fixed.formats.formats import Formats, Quantity, exponent
from kfgen.fixed.program.cells import packed

KEPT = 5  # bits of the process noise of a step


def covariances(code: FilterCode, formats: Formats, noise: list[list[float]]) -> None:
    """Of a filter, or of each mode's. noise: what a step adds to each variance (modes, n)."""
    if not code.modes:
        _covariance(code, formats, "", code.order, noise[0])
        return
    for mode, added in zip(code.modes, noise, strict=True):
        _covariance(code, formats, f"modes.{mode.name}.", mode.order, added)


def _covariance(code: FilterCode, f: Formats, place: str, order: tuple[int, ...], noises: list[float]) -> None:
    """P_ij at the mean of P_ii and P_jj, which bound it. place: of the filter in the struct."""
    states = code.model.errors
    n = len(states)
    names = {block.name for block in code.blocks}
    fields = {name for name in ("D", "P", "S") if place + name in names}
    for j in range(n):  # head-room gives way to the process noise, which must not be rounded away
        state = order[j]
        index = j if "D" in fields else packed(j, j)
        cell = f.arrays.element(("array", f"kf.{place}D" if "D" in fields else f"kf.{place}P"), index)
        e, largest, noise = f.of(cell), f.ranges.largest(cell), noises[state]
        if "S" not in fields and e is not None and noise > 0:
            wanted = math.frexp(noise)[1] - 1 - KEPT
            f.fixed[cell] = max(min(e, wanted), exponent(1.05 * largest, 0))
        if e is not None and "S" not in fields:
            name = f"{place}{'D' if 'D' in fields else 'P'}[{states[state]}]"
            gave = "room given to process noise" if f.fixed[cell] < e else ""
            f.report.append(Quantity(name.removeprefix("modes."), largest, f.fixed[cell], gave, BITS))
    if "P" not in fields:
        return
    P = ("array", f"kf.{place}P")
    diagonal = [f.ranges.largest(f.arrays.element(P, packed(j, j))) for j in range(n)]
    for j in range(n):
        for i in range(j + 1):
            f.ranges.see(f.arrays.element(P, packed(i, j)), math.sqrt(diagonal[i] * diagonal[j]))
