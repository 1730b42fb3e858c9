"""A fixed-point filter of a real one: runs, formats, integers, report."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from kfgen.emit.fixed_point import FixedPoint
from kfgen.errors import SpecError
from kfgen.filters.base import FilterCode
from kfgen.fixed import tables
from kfgen.fixed.cells import find_arrays
from kfgen.fixed.certificate import Certificate, certify, lines
from kfgen.fixed.formats import Formats, choose
from kfgen.fixed.lowering import lower
from kfgen.fixed.pace import Pace
from kfgen.fixed.probe import Departure, probe, shaken
from kfgen.fixed.random import Random
from kfgen.fixed.raw import size_of
from kfgen.fixed.real import Ranges, RealProgram
from kfgen.fixed.routines import closure
from kfgen.fixed.runs import Runner
from kfgen.fixed.scalar import Fixed
from kfgen.fixed.unroll import unrolled
from kfgen.fixed.weather import Weather
from kfgen.logs import Log

RUNS = ((1.0, 0.0, 0.5, 10), (2.0, 0.02, -0.5, 1), (1.0, 0.05, 0.0, 4))
"""Factor of the noises, share of outliers, correlation of the states that is given now and then, rows per reading."""
STEPS = 300
INFLATED = 2.0**22  # times a usual variance: what `adaptive` may make of it, or the usual one has no digits left
LONG = 2000  # of a filter whose covariance does not depend on the data: to its steady state
PROBED = 120  # rows that the integers are tried on
CHAOTIC = 16.0  # times as far as real numbers depart by less than what formats lose
FAILING = 0.25  # standard deviations by which they may be off


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
    runner = Runner(real, RealProgram(functions, arrays, ranges), ranges)
    spec = code.model.spec
    if log is not None:
        runner.run({name: list(column) for name, column in log.columns.items()}, log.rows)
    weather = Weather(code)
    pace = _nominal(runner, weather, real)
    if code.model.options.inflation is not None:
        runner.limits = [INFLATED * variance for variance in pace.typical()]
    for seed, (gain, outliers, correlation, every) in enumerate(RUNS, 2):
        log_, rows = weather.log(STEPS, Random(seed, gain), Random(100 + seed, gain, outliers))
        runner.run(log_, rows, correlation, every)
    noise = weather.process_noise()
    scale = None if spec.fixed.scale is None else _exponents(code)
    formats = choose(real, arrays, ranges, scalar.bits, scale, linear(code), noise, pace)
    lowered = lower(real, formats)
    found = _judge(runner.program, real, lowered, formats, scalar, weather)
    view = FixedPoint(scalar.bits, _units(lowered, formats), _table(formats), scalar.rounding == "floor", closure,
                      tables)  # fmt: skip
    return FixedFilter(lowered, real, formats, certify(lowered.functions, found.peaks), view)


def _nominal(runner: Runner, weather: Weather, code: FilterCode) -> Pace:
    """A run as the model says, and what its steps changed, near to where the covariance settles."""
    steps = LONG if linear(code) else STEPS
    log, rows = weather.log(steps + STEPS, Random(1), Random(101))
    pace, end = Pace(code, runner.program), min(rows, steps)
    memory = runner.run(log, end, watch=pace.look)
    factors = pace.factors()
    if factors is not None and end < rows:
        runner.rescale(memory, factors)
        pace = Pace(code, runner.program)
        runner.run(log, rows, watch=pace.look, start=(memory, end))
    return pace


def _judge(program: RealProgram, real: FilterCode, integer: FilterCode, formats: Formats, scalar: Fixed,
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
    cell = formats.arrays.element(("array", "get_covariance", "P"), i * n + i)
    return math.sqrt(formats.ranges.largest(cell)), math.sqrt(formats.ranges.smallest(cell))


def linear(code: FilterCode) -> bool:
    """Whether the covariance is the same whatever is measured: a linear model of constant coefficients."""
    model = code.model
    options = model.options
    if code.modes:
        return False
    if options.influence is not None or options.inflation is not None or model.spec.filter.type != "kf":
        moving = {*model.symbols} - {"dt"}
        for e in (*model.f, *(h for s in model.sensors for h in s.h)):
            for _, slope in model.partials(e):
                if {s.name for s in slope.free_symbols} & set(moving):
                    return False
        noisy = [e for row in model.Q for e in row] + [e for s in model.sensors for row in s.R for e in row]
        if any(e.free_symbols for e in noisy) or options.influence is not None or options.inflation is not None:
            return False
    return model.dt is not None and options.adapt_R is None and options.adapt_Q is None and not model.definitions


def _exponents(code: FilterCode) -> dict[str, int]:
    from kfgen.spec.constants import value

    spec = code.model.spec
    return {name: size_of(value(e.tree, spec)) - 1 for name, e in (spec.fixed.scale or {}).items()}


def _units(code: FilterCode, formats: Formats) -> tuple[tuple[str, int], ...]:
    spec = code.model.spec
    out = [(s.name, formats.arrays.element(("array", "kf.x"), i)) for i, s in enumerate(spec.states)]
    out += [(each.name, ("number", f"u.{each.name}")) for each in spec.inputs]
    out += [(each.name, ("number", f"kf.parameters.{each.name}")) for each in spec.parameters]
    out += [
        (f"{s.name}_{c.name}", ("number", f"update_{s.name}", f"z.{c.name}"))
        for s in spec.measurements for c in s.components
    ]  # fmt: skip
    if spec.dt is not None and spec.dt.run_time:
        out.append(("dt", ("number", "dt")))
    return tuple((name.upper(), formats.fixed[cell]) for name, cell in out)


def _table(formats: Formats) -> tuple[str, ...]:
    width = max((len(q.name) for q in formats.report), default=0)
    return tuple(
        f"{q.name:<{width}}  2^{q.e:<4} to {q.largest:<9.4g} {q.headroom:>2} bits {q.raised}".rstrip()
        for q in formats.report
    )
