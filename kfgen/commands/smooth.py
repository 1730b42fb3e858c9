"""`kfgen smooth`: a log smoothed."""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np

from kfgen.commands.options import (
    any_rate_option,
    columns_option,
    example,
    keep_apart,
    load_spec,
    log_of,
    spec_argument,
)
from kfgen.commands.progress import progress

LONG = 2000
"""Rows from which a progress bar is worth its flicker."""


@click.command(
    short_help="Smooth a log: estimates that know all of it.",
    epilog=example("kfgen smooth specs/vehicle.yaml drive.csv -o smoothed.csv"),
)
@spec_argument
@click.argument("log", type=click.Path(path_type=Path), metavar="LOG.csv")
@click.option("-o", "out", type=click.Path(path_type=Path), metavar="OUT.csv", help="Where the estimates go.")
@any_rate_option
@columns_option
def smooth(spec: Path, log: Path, out: Path | None, any_rate: bool, renamed: Path | None) -> None:
    """Write what the filter would have said of each row, had it known the whole log (Rauch-Tung-Striebel; of a ukf in
    its sigma-point form). In numpy, for what is done after a drive: nothing of it is emitted.

    The log is read and the columns are written as `kfgen run` does; nis and status are those of the filter on its way
    forwards. Late readings are taken in where they were made. Refused: imm, ekf2, adapt_R, adapt_Q, each with the
    reason. Exit status 1 where each update failed.
    """
    from kfgen import logs, smoothing
    from kfgen.commands.run import columns

    keep_apart({"the log": log, "the spec": spec}, {"-o": out})
    loaded = load_spec(spec)
    data = log_of(log, loaded, any_rate, renamed)
    with progress(data.rows, data.rows >= LONG) as advance:
        result = smoothing.smooth(loaded, data, lambda done, rows: advance(done, "filtering"))
    found = columns(loaded, result, np.float64)
    if out is None:
        logs.write_to(sys.stdout.buffer, found)
    else:
        logs.write(out, found)
    for counts in result.counts().values():
        text = ", ".join(f"{flag.name} in {number}" for flag, number in counts.items())
        click.echo(f"kfgen: the filter met errors: {text} of {data.rows} rows", err=True)
    if result.failed:
        click.echo("kfgen: every update failed", err=True)
        sys.exit(1)
