"""A fixed-point filter of a real one: ranges from runs, formats from ranges, integers, a trial of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kfgen.emit.fixed_point import FixedPoint
from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.routines import closure
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.formats.choose import choose
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.formats.report import table, units
from kfgen.fixed.linear import linear
from kfgen.fixed.lowering.lower import lower
from kfgen.fixed.program.cells import find_arrays
from kfgen.fixed.program.unroll import unrolled
from kfgen.fixed.ranges.drive import Drive
from kfgen.fixed.ranges.intervals import Intervals, spread
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.runs import Runner
from kfgen.fixed.ranges.survey import survey
from kfgen.fixed.ranges.weather import Weather
from kfgen.fixed.trial.certificate import Certificate, certify, lines
from kfgen.fixed.trial.judge import judge
from kfgen.logs import Log

WIDER = 2.0**6  # times what runs have met: an interval that is wider than that has overrated its value


@dataclass(frozen=True)
class FixedFilter:
    """The integer filter and what is to be said of it."""

    code: FilterCode
    real: FilterCode
    formats: Formats
    certificates: tuple[Certificate, ...]  # of its functions
    view: FixedPoint

    def certified(self) -> tuple[str, ...]:
        """The certificates as a table."""
        return lines(self.certificates)


def build_fixed(code: FilterCode, scalar: Fixed, log: Log | None = None) -> FixedFilter:
    """Scale and lower a filter. log: runs beside the simulated ones. Raises SpecError where ranges do not fit."""
    real = replace(code, functions=tuple(unrolled(f, code.constants) for f in code.functions))
    functions = list(real.functions)
    arrays, ranges = find_arrays(functions), Ranges()
    program, weather, constant = RealProgram(functions, arrays, ranges), Weather(real), linear(real)
    runner = Runner(real, program, ranges)
    drive = Drive(runner, weather)
    pace = survey(runner, weather, drive, log, constant)
    intervals = Intervals(real.model, weather.box, ranges)
    if weather.box.wide:
        intervals.read(functions)
        spread(intervals, WIDER)
    formats = choose(real, arrays, ranges, scalar.bits, constant, weather.process_noise(), pace)
    lowered = lower(real, formats)
    found = judge(program, real, lowered, formats, scalar, weather)
    view = FixedPoint(scalar.bits, units(lowered, formats), table(formats), scalar.rounding == "floor", closure,
                      tables)  # fmt: skip
    return FixedFilter(lowered, real, formats, certify(lowered.functions, found.peaks), view)
