"""`kfgen report`: one page on a filter and its course over logs."""

from __future__ import annotations

import json
from pathlib import Path

import click

from kfgen.commands.options import (
    any_rate_option,
    columns_option,
    example,
    keep_apart,
    load_spec,
    log_of,
    ranges_option,
    read_ranges,
    scalar_option,
    spec_argument,
)
from kfgen.commands.progress import progress
from kfgen.errors import KfgenError


@click.command(
    short_help="One page on a filter and its course over logs.",
    epilog=example(
        "kfgen report specs/vehicle.yaml --log drive.csv -o report.html",
        "kfgen report specs/cv4.yaml --simulate 1000 --target cortex-m0 --mhz 48 -o report.html",
        "kfgen report specs/vehicle.yaml --log drive.csv --json",
    ),
)
@spec_argument
@click.option("--log", "logs", multiple=True, type=click.Path(path_type=Path), metavar="LOG", help="May be repeated.")
@click.option(
    "--simulate", type=click.IntRange(2), metavar="N", help="Also a log of N rows, drawn from the spec's own model."
)
@click.option(
    "--target", metavar="T", default="cortex-m4f", show_default=True, help="What costs are measured on; see kfgen cost."
)
@click.option(
    "--mhz", type=click.FloatRange(0, min_open=True), metavar="N", help="Clock of the target, for microseconds."
)
@click.option("--no-run", is_flag=True, help="Only what the spec and its code tell; takes no compiler.")
@click.option("-o", "out", type=click.Path(path_type=Path), metavar="REPORT.html", help="Where the page goes.")
@any_rate_option
@columns_option
@scalar_option
@ranges_option
@click.option("--json", "as_json", is_flag=True, help="Print the page's figures as JSON.")
def report(
    spec: Path,
    logs: tuple[Path, ...],
    simulate: int | None,
    target: str,
    mhz: float | None,
    no_run: bool,
    out: Path | None,
    any_rate: bool,
    renamed: Path | None,
    scalar: str | None,
    ranges: Path | None,
    as_json: bool,
) -> None:
    """Write a report that a reviewer can sign: the model with its equations, its structure and what the sensors can
    tell, the run, the innovations (size, whiteness, normality), the errors against columns true.<state>, where each
    state's variance comes from, costs, and the formats of fixed point.

    One HTML file: no script, nothing from elsewhere, light and dark, made to be printed. Without --log the log is
    simulated. Of a long log the first 4000 rows are linearised one by one; all of it is run.

    Needs `pip install 'kfgen[plot]'` and a C compiler; without a cross compiler the costs are left out, and it says so.
    """
    from kfgen.files import write_all
    from kfgen.report import made

    if out is None and not as_json:
        raise KfgenError("nothing to do: name the page with -o REPORT.html, or ask for --json")
    if no_run and (logs or simulate is not None):
        raise KfgenError("--no-run has no use for a log")
    keep_apart({"the spec": spec, **{f"the log {log}": log for log in logs}}, {"-o": out})
    loaded = load_spec(spec, scalar)
    data = [log_of(log, loaded, any_rate, renamed) for log in logs]
    ranges_log = read_ranges(ranges, loaded)
    with progress(1000) as advance:

        def passed(done: int, of: int, what: str) -> None:
            advance(1000 * done // max(of, 1), what)

        found = made(loaded, data, simulate, target, mhz, not no_run, ranges_log, passed)
    if out is not None:
        write_all({out: found.html.encode()})
    if as_json:
        click.echo(json.dumps(found.data, indent=2))
