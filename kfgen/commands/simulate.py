"""`kfgen simulate`: a log from the spec's own model."""

from __future__ import annotations

from pathlib import Path

import click

from kfgen.commands.options import example, keep_apart, load_spec, spec_argument


def _rates(ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, int]:
    rates = {}
    for value in values:
        sensor, _, number = value.partition("=")
        if not number.isdecimal() or int(number) < 1:
            raise click.BadParameter(f"{value!r} is not SENSOR=N with a whole number N of at least 1")
        rates[sensor] = int(number)
    return rates


def _delays(ctx: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, float]:
    delays = {}
    for value in values:
        sensor, _, number = value.partition("=")
        try:
            delays[sensor] = float(number)
        except ValueError:
            raise click.BadParameter(f"{value!r} is not SENSOR=S with a number of seconds S") from None
    return delays


@click.command(
    short_help="Draw a log from the spec's own model.",
    epilog=example(
        "kfgen simulate specs/vehicle.yaml -o vehicle.csv",
        "kfgen simulate specs/vehicle.yaml -o vehicle.csv --steps 2000 --every gnss=10",
        "kfgen simulate specs/vehicle.yaml -o late.csv --delay gnss=0.2",
    ),
)
@spec_argument
@click.option("-o", "out", type=click.Path(path_type=Path), required=True, metavar="LOG.csv", help="The log to write.")
@click.option("--steps", type=click.IntRange(1), default=500, show_default=True, help="Rows of the log.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The same seed gives the same log.")
@click.option(
    "--every", multiple=True, callback=_rates, metavar="SENSOR=N",
    help="This sensor measures in every N-th row only; may be repeated.",
)  # fmt: skip
@click.option(
    "--delay", "delays", multiple=True, callback=_delays, metavar="SENSOR=S",
    help="The readings of this sensor arrive so many s after they were made; may be repeated.",
)  # fmt: skip
def simulate(
    spec: Path, out: Path, steps: int, seed: int, every: dict[str, int], delays: dict[str, float]
) -> None:
    """Write a log drawn from the spec's own model, with the truth in columns true.<state>.

    The first state is drawn from N(x0, P0), and so are all noises. Inputs are slow sines within a quarter of
    their range (of amplitude 1 where they have none). A run-time dt is the nominal one with 10 % of jitter.
    Where the truth leaves a declared range, a warning says so.

    With --delay each reading of the sensor stands in the first row at or after its arrival; the column <sensor>.age
    says in s how old it is then.
    """
    from kfgen import simulate as simulation
    from kfgen.excursions import excursions
    from kfgen.late import delayed
    from kfgen.logs import write

    keep_apart({"the spec": spec}, {"-o": out})
    loaded = load_spec(spec)
    log = simulation.simulate(loaded, steps, seed, every)
    write(out, delayed(loaded, log, delays).columns)
    for warning in excursions(loaded, log.columns):
        click.echo(warning, err=True)
