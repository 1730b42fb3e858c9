"""A fixed-point filter of a real one: ranges from runs, formats from ranges, integers, a trial of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from kfgen.emit.fixed_point import FixedPoint
from kfgen.errors import SpecError
from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.routines import closure
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.formats.choose import choose
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.formats.report import periods, table, units
from kfgen.fixed.linear import linear
from kfgen.fixed.lowering.lower import lower
from kfgen.fixed.program.cells import find_arrays
from kfgen.fixed.program.inline import inlined
from kfgen.fixed.program.nodes import nodes_of
from kfgen.fixed.program.unroll import unrolled
from kfgen.fixed.ranges.box import Box
from kfgen.fixed.ranges.drive import Drive, Player, Seen
from kfgen.fixed.ranges.intervals import Intervals, spread
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.recorder import Recorder, unknown
from kfgen.fixed.ranges.runs import Runner
from kfgen.fixed.ranges.survey import survey
from kfgen.fixed.ranges.weather import Weather
from kfgen.fixed.trial.certificate import Certificate, certify, lines
from kfgen.fixed.trial.integers import IntegerProgram
from kfgen.fixed.trial.judge import hear, judge, refuse
from kfgen.fixed.trial.tour import ShakenTour, Tour
from kfgen.ir.nodes import Node
from kfgen.logs import Log

WIDER = 2.0**6  # times what runs have met: an interval that is wider than that has overrated its value
DRIVEN, TRIED = 21, 31  # seeds of the runs over the box, of the first trial
TRIALS = 2  # each with runs of its own, until nothing saturates
MANY, FEW = 16, 8  # legs that fill the box, of the runs and of a trial
ROWS, LEAST = 40, 4  # rows of a leg, beside those without readings; the least of rows and legs
OUTAGES = (24, 12, 0)  # rows without readings
SIZE = 2000  # operations of a program from which on runs are shorter
SHORT = 12  # what is less than that is told of


@dataclass(frozen=True)
class FixedFilter:
    """The integer filter and what is to be said of it."""

    code: FilterCode
    real: FilterCode
    formats: Formats
    certificates: tuple[Certificate, ...]  # of its functions
    view: FixedPoint
    widest: Mapping[str, Seen] = field(default_factory=dict)  # how far the runs over the declared box have gone
    told: tuple[str, ...] = ()  # where in the box the filter has not been held

    def certified(self) -> tuple[str, ...]:
        """The certificates as a table."""
        widest = {name: (seen.low, seen.high) for name, seen in self.widest.items()}
        return *lines(self.certificates, widest), *self.told


def build_fixed(code: FilterCode, scalar: Fixed, logs: Sequence[Log] = ()) -> FixedFilter:
    """Scale and lower a filter. logs: runs beside the simulated ones. Raises SpecError where ranges do not fit."""
    return _Builder(code, scalar, logs).build()


@dataclass(frozen=True)
class Part:
    """A part of the declared box, and for how many rows there may be no reading in it.

    limits: variances at which a state is as good as unknown. spare: bits of further head-room for covariances, for
    corners that no run has been in.
    """

    box: Box
    outage: int
    limits: Sequence[float] = ()
    spare: int = 0


def _less(part: Part, whole: Box, reason: SpecError) -> tuple[str, ...]:
    """What is said of a filter that holds in a part of its box only."""
    where = []
    if part.outage < SHORT:
        where.append(f"for at most {part.outage} steps without readings" if part.outage else "without outages")
    if part.box != whole:
        where.append("for states near where the model itself leads")
    mistake = reason.mistakes[0]
    why = f"not in all of the declared ranges: {mistake.message}; {mistake.hint}"
    return (f"holds {' and '.join(where)}, {why}",) if where else ()


@dataclass(frozen=True)
class _Lowered:
    """Integers, their formats, and a program that runs them."""

    code: FilterCode
    formats: Formats
    program: IntegerProgram


class _Builder:
    """Tries formats for the whole box first, then for less of it."""

    def __init__(self, code: FilterCode, scalar: Fixed, logs: Sequence[Log]) -> None:
        self.scalar = scalar
        self.real = replace(code, functions=tuple(unrolled(f, code.constants) for f in inlined(code.functions)))
        self.functions = list(self.real.functions)
        self.arrays, self.ranges = find_arrays(self.functions), Ranges()
        self.program = RealProgram(self.functions, self.arrays, self.ranges)
        self.weather = Weather(self.real)
        self.box = self.weather.box
        self.linear = linear(self.real)
        self.runner = Runner(self.real, self.program, self.ranges)
        self.pace = survey(self.runner, self.weather, logs, self.linear)
        self.met = self.ranges.copy()
        self.sizes: Mapping[Node, float] = {}
        size = sum(node.kind == "real" for f in self.functions for node in nodes_of(f.body))
        self.share = min(1.0, SIZE / size)

    def build(self) -> FixedFilter:
        refusals: list[SpecError] = []
        parts = self._parts()
        for part in parts:
            self.ranges.restore(self.met)
            drive = Drive(self.weather, part.box, part.outage)
            if self.box.wide:
                self._see(drive, part)
            try:
                made = self._toured(drive, part, part is parts[-1])
            except SpecError as error:
                refusals.append(error)
            else:
                return made if not refusals else replace(made, told=(*made.told, *_less(part, self.box, refusals[0])))
        raise refusals[0]

    def _parts(self) -> list[Part]:
        """From all that is wanted to the least that is of use."""
        box, longest = self.box, OUTAGES[0]
        if not box.wide:
            return [Part(box, outage) for outage in OUTAGES]
        known = unknown(box, [float(row[i]) for i, row in enumerate(self.real.model.P0)])
        return [Part(box, longest, known, spare=1), *(Part(box, outage, known) for outage in OUTAGES),
                Part(box.without_states(), 0, known)]  # fmt: skip

    def _see(self, drive: Drive, part: Part) -> None:
        """Runs over a part of the box, and what intervals say of it."""
        self._run(drive, Recorder(self.runner, self.box, part.limits), DRIVEN, MANY)
        intervals = Intervals(self.real.model, part.box, self.ranges)
        intervals.read(self.functions)
        self.sizes = intervals.sizes
        spread(intervals, WIDER)

    def _toured(self, drive: Drive, part: Part, last: bool) -> FixedFilter:
        """A filter that has been tried all over a part; what its trial has met counts where something saturated. last:
        there is no smaller part."""
        for trial in range(TRIALS):
            found = self._lowered(part.spare)
            told = self._judged(found)
            tour = Tour(self.program, found.program, self.real, found.formats, found.code, self.box, part.limits)
            self._run(drive, tour, TRIED + trial, FEW)
            if not tour.found.saturated:
                break
        if not tour.found.carried:
            shaken = ShakenTour(self.program, self.real, found.formats, self.box, part.limits)
            self._run(drive, shaken, TRIED + trial, FEW)
            told = *told, *refuse(tour.found, shaken.found, self.real, found.formats, self.scalar, last)
        return replace(self._filter(found), widest=dict(drive.seen) if self.box.wide else {}, told=told)

    def _run(self, drive: Drive, player: Player, seed: int, inner: int) -> None:
        """Legs over the box; what has many operations is given fewer and shorter ones."""
        drive.run(player, seed, max(LEAST, int(inner * self.share)), max(LEAST, int(ROWS * self.share)))

    def _lowered(self, spare: int) -> _Lowered:
        hear(self.real.model.spec, self.runner.heard)
        noise = self.weather.process_noise()
        formats = choose(self.real, self.arrays, self.ranges, self.scalar.bits, self.linear, noise, self.pace,
                         self.sizes, spare)  # fmt: skip
        code = lower(self.real, formats)
        return _Lowered(code, formats, IntegerProgram(list(code.functions), self.arrays, self.scalar))

    def _judged(self, found: _Lowered) -> tuple[str, ...]:
        return judge(self.program, self.real, found.program, found.code, found.formats, self.scalar, self.weather)

    def _filter(self, found: _Lowered) -> FixedFilter:
        """What is handed on."""
        view = FixedPoint(self.scalar.bits, units(found.code, found.formats), table(found.formats),
                          self.scalar.rounding == "floor", closure, tables, periods(self.real.model))  # fmt: skip
        certificates = certify(found.code.functions, found.program.peaks, found.formats.fitting)
        return FixedFilter(found.code, self.real, found.formats, certificates, view)
