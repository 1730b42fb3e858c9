"""`kfgen run`: the compiled filter over a log."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from numpy.typing import NDArray

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
from kfgen.commands.plain import json_option, of_run, tell
from kfgen.commands.progress import progress
from kfgen.commands.tables import Table, on_terminal, show
from kfgen.scalar_names import FLOAT

if TYPE_CHECKING:
    from kfgen.native.run import RunResult
    from kfgen.spec.types import Spec

LONG = 200_000
"""Rows from which a progress bar is worth its flicker."""


@click.command(
    short_help="Run the compiled filter over a log.",
    epilog=example(
        "kfgen run specs/vehicle.yaml drive.csv -o estimate.csv",
        "kfgen run specs/vehicle.yaml drive.csv --plot estimate.png",
    ),
)
@spec_argument
@click.argument("log", type=click.Path(path_type=Path), metavar="LOG.csv")
@click.option("-o", "out", type=click.Path(path_type=Path), metavar="OUT.csv", help="Where the estimates go.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="OUT.png", help="Draw the estimates.")
@any_rate_option
@columns_option
@scalar_option
@ranges_option
@json_option
def run(
    spec: Path,
    log: Path,
    out: Path | None,
    plot: Path | None,
    any_rate: bool,
    renamed: Path | None,
    scalar: str | None,
    ranges: Path | None,
    as_json: bool,
) -> None:
    """Run the compiled filter over a log with the columns t, <input>, <sensor>.<component>, <sensor>.<its input>.

    An empty cell is no measurement; a sensor with only some of its components is not updated, unless it is
    `partial: true`. An empty input keeps its last value. Per row: predict, then the updates in the spec's
    order. With a run-time dt, dt is t minus the last t, and there is no predict in the first row and for
    equal t. With a fixed dt there is one predict per row; where the log has a t, none for equal t, and t must go on by
    dt: exit status 2 where it falls, its usual step is not dt (5 %), or over 1 % of
    its steps exceed 1.5 dt. Exit status 1 where each update failed.

    A filter with a `history` takes late measurements: the column <sensor>.age (s), or <sensor>.time (s, when it was
    made), tells of them; rows stand in the order of arrival.

    The result has the columns t, x.<state>, var.<state>, nis.<sensor>, status, mu.<mode>, out.<output>,
    out_std.<output>. It goes to OUT.csv, or to stdout if none of -o, --plot and --json is given.
    """
    from kfgen import logs, native

    keep_apart({"the log": log, "the spec": spec}, {"-o": out, "--plot": plot})
    if plot is not None:
        from kfgen.plot import require_matplotlib

        require_matplotlib()
    loaded = load_spec(spec, scalar)
    data = log_of(log, loaded, any_rate, renamed)
    kf = native.compile(loaded, log=read_ranges(ranges, loaded), history=loaded.history is not None)
    with progress(data.rows, data.rows >= LONG) as advance:
        result = kf.run(data, lambda done, rows: advance(done, "running"))
    _report(result)
    for line in _told_late(loaded, result):
        click.echo(f"kfgen: {line}", err=True)
    if out is not None:
        logs.write(out, columns(loaded, result))
    elif plot is None and not as_json:
        logs.write_to(sys.stdout.buffer, columns(loaded, result))
    if plot is not None:
        from kfgen.plot import draw

        draw(plot, loaded, data, result)
    if as_json:
        tell(of_run(result))
    if result.failed:
        click.echo("kfgen: every update failed", err=True)
        sys.exit(1)


def columns(
    spec: Spec, result: RunResult, precision: type[np.floating[Any]] | None = None
) -> dict[str, NDArray[np.generic]]:
    """A run as columns of a CSV file; numbers keep the filter's own precision, or have the one that is given."""
    own = precision or (np.float32 if spec.scalar == FLOAT else np.float64)  # so that they print as short as they are
    out: dict[str, NDArray[np.generic]] = {"t": result.t}
    names = [state.name for state in spec.states]
    wide = spec.code.compensated
    out |= {f"x.{name}": result.x[:, i].astype(np.float64 if name in wide else own) for i, name in enumerate(names)}
    out |= {f"var.{name}": result.var[:, i].astype(own) for i, name in enumerate(spec.errors)}
    out |= {f"nis.{name}": nis.astype(own) for name, nis in result.nis.items()}
    out["status"] = result.status
    if result.mu is not None and spec.imm is not None:
        out |= {f"mu.{mode.name}": result.mu[:, i].astype(own) for i, mode in enumerate(spec.imm.modes)}
    out |= {f"out.{name}": value.astype(own) for name, value in result.outputs.items()}
    out |= {f"out_std.{name}": deviation.astype(own) for name, deviation in result.output_std.items()}
    return out


def _report(result: RunResult) -> None:
    """What the filter refused, and what it warned of, on stderr: a table for a person, a line each otherwise."""
    rows, found = len(result.t), []
    for errors, kind in ((True, "error"), (False, "warning")):
        for function, counts in result.counts(errors).items():
            found.append((function, kind, ", ".join(f"{flag.name} {number}x" for flag, number in counts.items())))
    if found and on_terminal(err=True):
        show(Table([("function", "", f"times in {rows} rows"), *found]), err=True)
        return
    for function, kind, text in found:
        click.echo(f"kfgen: {function}: {kind} {text} in {rows} rows", err=True)


def _told_late(spec: Spec, result: RunResult) -> list[str]:
    """What late measurements cost: predictions, with the updates after them, that were made again."""
    more = (spec.history.keep - 1) / 2 if spec.history is not None else 0.0
    return [
        f"{name}: {count} late measurements, {mean + more:.3g} predictions repeated for each on average, at most {most}"
        for name, (count, mean, most) in result.late().items()
    ]
