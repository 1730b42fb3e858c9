"""Where a simulated track leaves the ranges that its spec declares, for which a fixed-point filter is made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import Place
from kfgen.spec.constants import value
from kfgen.spec.types import Range, Spec

Array = NDArray[np.float64]


def excursions(spec: Spec, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """A warning for each range that the truth of a simulated log leaves: how far, and in which share of rows."""
    found = []
    for name, place, column, (low, high) in _declared(spec, columns):
        out = _outside(column, low, high)
        if np.any(out):
            found.append(
                f"{place.file}:{place.line}:{place.column}: warning: {place.path}: the simulated `{name}` goes from "
                f"{np.min(column):.4g} to {np.max(column):.4g}, and is outside of its range [{low:.4g}, "
                f"{high:.4g}] in {np.mean(out):.1%} of the rows; declare what it may be, or simulate fewer --steps"
            )
    return tuple(found)


def rows_outside(spec: Spec, columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    """For each row of a simulated log, whether anything in it is outside of its declared range."""
    rows = len(next(iter(columns.values())))
    total = np.zeros(rows, dtype=bool)
    for _, _, column, (low, high) in _declared(spec, columns):
        total |= _outside(column, low, high)
    return total


def _outside(column: Array, low: float, high: float) -> NDArray[np.bool_]:
    out: NDArray[np.bool_] = (column < low) | (column > high)
    return out


def _declared(spec: Spec, columns: Mapping[str, Array]) -> Iterator[tuple[str, Place, Array, tuple[float, float]]]:
    """Name, place, truth, and the ends of the range, of every state that has one."""
    for state in spec.states:
        if state.range is not None and state.period is None:
            yield state.name, state.place, columns[f"true.{state.name}"], _ends(state.range, spec)


def _ends(declared: Range, spec: Spec) -> tuple[float, float]:
    low, high = (float(value(end.tree, spec)) for end in declared)
    return low, high
