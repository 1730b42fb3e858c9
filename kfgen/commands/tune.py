"""`kfgen tune`: the numbers of a spec fitted to logs."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

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
from kfgen.commands.tables import Part, Table, show
from kfgen.errors import KfgenError

if TYPE_CHECKING:
    from kfgen.tuning import Tuned

INTERRUPTED = 130
USUAL = 1500  # runs that a tuning takes, about
STRONG = 0.7  # a correlation that is worth a line


@click.command(
    short_help="Fit noises, and any number in the spec, to logs.",
    epilog=example(
        "kfgen tune specs/vehicle.yaml drive.csv -o tuned.yaml",
        "kfgen tune specs/vehicle.yaml monday.csv tuesday.csv --free gyro_noise,measurements.speed.z.v.std",
        "kfgen tune specs/battery.yaml cycle.csv --free constants.r_series --holdout 0.3 --json",
    ),
)
@spec_argument
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--free", metavar="PATH,...", default="", help="What may change; all noises without it.")
@click.option("--objective", type=click.Choice(["likelihood", "rmse"]), default="likelihood", show_default=True,
              help="rmse: the error against the columns true.<state>.")  # fmt: skip
@click.option("--holdout", type=click.FloatRange(0, 1, max_open=True), default=0.2, show_default=True, metavar="SHARE",
              help="Of the rows, the last of each log, which are judged and not fitted.")  # fmt: skip
@click.option("--robust", is_flag=True, help="Let no outlier pull more than one at the 99.9 % limit does.")
@click.option("-o", "out", type=click.Path(path_type=Path), metavar="TUNED.yaml", help="The spec with the new numbers.")
@any_rate_option
@columns_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def tune(
    spec: Path,
    logs: tuple[Path, ...],
    free: str,
    objective: str,
    holdout: float,
    robust: bool,
    out: Path | None,
    any_rate: bool,
    renamed: Path | None,
    as_json: bool,
) -> None:
    """Fit numbers of a spec to logs, by the likelihood of the innovations: parameters, constants, std, var, density,
    entries of Q and R, numbers in formulas, initial states.

    A PATH is that of the spec's keys (measurements.gnss.z.x.std, dynamics.Q.v, parameters.gyro_noise), or an end of it
    that only one has. Positive numbers are fitted in their logarithm. Prints each number's old value, new value and
    standard error, which of them move together, what the logs cannot tell, and the likelihood and mean NIS of the rows
    that were fitted and of those that were held out. What the gate rejects counts as an outlier.

    Ctrl-C ends the search, and prints what is there. -o writes the spec: only these numbers change in it.
    """
    from kfgen.files import write_all
    from kfgen.tuning import tuned

    keep_apart({"the spec": spec, **{f"the log {log}": log for log in logs}}, {"-o": out})
    loaded = load_spec(spec)
    data = [log_of(log, loaded, any_rate, renamed) for log in logs]
    paths = [path.strip() for path in free.split(",") if path.strip()]
    if free and not paths:
        raise KfgenError("--free names nothing")
    with progress(USUAL) as advance:
        found = tuned(
            loaded, data, paths, objective, holdout, robust, lambda done, what: advance(min(done, USUAL), what)
        )
    if out is not None:
        write_all({out: found.text().encode()})
    if as_json:
        click.echo(json.dumps(found.as_json(), indent=2))
    else:
        show(*report(found))
    if found.interrupted:
        click.echo("kfgen: interrupted: this is what had been found, without standard errors", err=True)
        sys.exit(INTERRUPTED)


def report(found: Tuned) -> list[Part]:
    """What was found, as tables and sentences."""
    plain = found.as_json()
    rows = [("number", "old", "new", "std error")]
    for each in plain["parameters"]:
        rows.append((each["path"], f"{each['old']:.6g}", f"{each['new']:.6g}", _figure(each["std_error"], ".2g")))
    parts: list[Part] = [Table(rows, right=(1, 2, 3))]
    names = [each["path"] for each in plain["parameters"]]
    pairs = plain["correlation"] or []
    for i, row in enumerate(pairs):
        for j in range(i):
            if row[j] is not None and abs(row[j]) > STRONG:
                parts.append(f"{names[j]} and {names[i]} move together: correlation {row[j]:+.2f}")
    parts += [f"not identifiable: {text}" for text in plain["unidentified"]]
    ll, held = plain["log_likelihood"], found.holdout > 0
    out = [
        ("", "fitted rows", "", *(("held out", "") if held else ())),
        ("", "before", "after", *(("before", "after") if held else ())),
    ]
    out.append(("log-likelihood", *(_figure(ll[key], ".2f") for key in _keys(held))))
    for name, nis in plain["nis"].items():
        out.append((f"NIS {name}", *(_figure(nis[key], ".3f") for key in _keys(held))))
    return [*parts, "", Table(out, right=range(1, len(out[0]))), f"{plain['trials']} runs"]


def _keys(held: bool) -> tuple[str, ...]:
    return ("before", "after", *(("holdout_before", "holdout_after") if held else ()))


def _figure(number: float | None, form: str) -> str:
    return "" if number is None else format(number, form)
