"""All runs that binary points are chosen from: of the user's log, nominal ones, and bad weather."""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.pace import Pace
from kfgen.fixed.ranges.runs import Runner
from kfgen.fixed.ranges.weather import Weather
from kfgen.logs import Log

RUNS = ((1.0, 0.0, 0.5, 10), (2.0, 0.02, -0.5, 1), (1.0, 0.05, 0.0, 4))
"""Factor of the noises, share of outliers, correlation of the states that is given now and then, rows per reading."""
STEPS = 300
LONG = 2000  # of a filter whose covariance does not depend on the data: to its steady state
INFLATED = 2.0**22  # times a usual variance: what `adaptive` may make of it, or the usual one has no digits left


def survey(runner: Runner, weather: Weather, logs: Sequence[Log], linear: bool) -> Pace:
    """Make them; what the steps of the nominal run changed.

    logs: further runs of the user's. linear: the covariance does not depend on the data.
    """
    for log in logs:
        runner.run({name: list(column) for name, column in log.columns.items()}, log.rows)
    pace = _nominal(runner, weather, LONG if linear else STEPS)
    if any(options.inflation is not None for options in runner.code.model.every_options):
        runner.limits = [INFLATED * variance for variance in pace.typical()]
    for seed, (gain, outliers, correlation, every) in enumerate(RUNS, 2):
        columns, rows = weather.log(STEPS, Random(seed, gain), Random(100 + seed, gain, outliers))
        runner.run(columns, rows, correlation, every)
    return pace


def _nominal(runner: Runner, weather: Weather, steps: int) -> Pace:
    """A run as the model says, and what its steps changed, near to where the covariance settles."""
    code = runner.code
    log, rows = weather.log(steps + STEPS, Random(1), Random(101))
    pace, end = Pace(code, runner.program), min(rows, steps)
    memory = runner.run(log, end, watch=pace.look)
    factors = pace.factors()
    if factors is not None and end < rows:
        runner.rescale(memory, factors)
        pace = Pace(code, runner.program)
        runner.run(log, rows, watch=pace.look, start=(memory, end))
    return pace
