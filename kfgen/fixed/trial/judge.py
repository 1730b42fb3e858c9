"""Whether the integers carry a filter: they are tried, and what they may be off by is weighed."""

from __future__ import annotations

import math

from kfgen.errors import SpecError
from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.weather import Weather
from kfgen.fixed.trial.probe import Departure, probe, shaken

PROBED = 120  # rows that the integers are tried on
CHAOTIC = 16.0  # times as far as real numbers depart by less than what formats lose
FAILING = 0.25  # standard deviations by which they may be off


def judge(program: RealProgram, real: FilterCode, integer: FilterCode, formats: Formats, scalar: Fixed,
          weather: Weather) -> Departure:  # fmt: skip
    """Try the integers beside the real numbers. SpecError where they do not follow."""
    log, rows = weather.log(PROBED, Random(11), Random(111))
    found = probe(program, real, integer, formats, scalar, log, rows)
    if found.sigmas <= FAILING and not found.errors:
        return found
    if not found.errors and not found.beyond(shaken(program, real, formats, log, rows), FAILING, CHAOTIC):
        return found  # the model magnifies whatever is rounded
    state = real.model.spec.states[found.state]
    bits = max(1, math.ceil(math.log2(min(found.sigmas, 1e9) / FAILING))) if found.sigmas > FAILING else 1
    largest, least = _spread(formats, found.state, len(real.model.states))
    what = f"{scalar.name} cannot carry `{state.name}`"
    if least > 0:
        what += f": its standard deviation goes from {largest:.3g} to {least:.3g}"
    raise SpecError.at(
        state.place, f"{what}; {bits} bit{'s' * (bits > 1)} are missing",
        "start with a smaller std, declare a range, try covariance: sqrt, or use float",
    )  # fmt: skip


def _spread(formats: Formats, i: int, n: int) -> tuple[float, float]:
    """The largest and the smallest standard deviation of a state that the runs have met."""
    cell = formats.arrays.variance(i, n)
    return math.sqrt(formats.ranges.largest(cell)), math.sqrt(formats.ranges.smallest(cell))
