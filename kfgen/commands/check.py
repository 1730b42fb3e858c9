"""`kfgen check`: the generated C against the reference."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from kfgen.commands.options import example, load_spec, scalar_option, spec_argument


@click.command(
    short_help="Hold the generated C against the numpy reference.",
    epilog=example("kfgen check specs/vehicle.yaml"),
)
@spec_argument
@scalar_option
def check(spec: Path, scalar: str | None) -> None:
    """Compile what would be emitted and hold it against the numpy reference on a random track.

    Prints the largest error of x (in standard deviations) and of P (relative to sqrt(P_ii P_jj)) and the
    calls whose status differs. Exit status 1 past the tolerance: 2e-3 for float, 1e-6 for double, 2e-2 for
    fixed point.
    """
    from kfgen.check import check as compare

    outcome = compare(load_spec(spec, scalar))
    click.echo(outcome.text())
    sys.exit(0 if outcome.passed else 1)
