"""`kfgen check`: the generated C against the reference."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kfgen.commands.options import (
    example,
    load_spec,
    quiet_option,
    ranges_option,
    read_ranges,
    scalar_option,
    spec_argument,
    tell_advice,
)
from kfgen.commands.plain import json_option, of_check, tell
from kfgen.commands.tables import Part, Table, Verdict, show

if TYPE_CHECKING:
    from kfgen.check import Outcome


@click.command(
    short_help="Hold the generated C against the numpy reference.",
    epilog=example("kfgen check specs/vehicle.yaml"),
)
@spec_argument
@scalar_option
@ranges_option
@quiet_option
@json_option
def check(spec: Path, scalar: str | None, ranges: Path | None, quiet: bool, as_json: bool) -> None:
    """Compile what would be emitted and hold it against the numpy reference on a random track.

    Prints the largest error of x (in standard deviations) and of P (relative to sqrt(P_ii P_jj)) and the
    calls whose status differs. Exit status 1 past the tolerance: 2e-3 for float, 1e-6 for double, 2e-2 for
    fixed point; and where a float of a state's size resolves no tenth of its standard deviation in 8 roundings.
    """
    from kfgen.check import check as compare
    from kfgen.generate import build as generate

    loaded = load_spec(spec, scalar)
    if not quiet:
        tell_advice(loaded)
    log = read_ranges(ranges, loaded)
    outcome = compare(loaded, generated=None if log is None else generate(loaded, log=log))
    if as_json:
        tell(of_check(outcome))
    else:
        show(*report(outcome))
    sys.exit(0 if outcome.passed else 1)


def report(outcome: Outcome) -> list[Part]:
    """The result: the largest errors and where they were, what is to be known beside, the verdict."""
    remarks = []
    if outcome.differences:
        remarks.append(f"status: differs in {len(outcome.differences)} calls, first in {outcome.differences[0]}")
    if 8 * outcome.resolution > outcome.tolerance:
        remarks.append(f"a reference with its x rounded to {outcome.scalar}: {outcome.resolution:.1e} sigma")
    if outcome.lost:
        remarks.append(f"{outcome.lost} steps not compared: rounding alone moves the reference further than that")
    if outcome.outside:
        remarks.append(
            f"{outcome.outside} steps not compared: there the model's own track is outside of what the spec declares "
            f"(`kfgen simulate` says where); widen the ranges, or the filter is not made for it"
        )
    remarks += outcome.coarse
    return [
        f"{outcome.name} ({outcome.scalar}): {outcome.steps} steps, {outcome.calls} calls against the reference",
        Table(
            [
                ["quantity", "largest error", "of", "where"],
                ["x", f"{outcome.x.error:.1e}", "sigma", outcome.x.where],
                ["P", f"{outcome.P.error:.1e}", "sqrt(P_ii P_jj)", outcome.P.where],
            ],
            right=(1,),
        ),
        *remarks,
        *outcome.certificate,
        Verdict(f"tolerance {outcome.tolerance:.0e}: {'passed' if outcome.passed else 'FAILED'}", outcome.passed),
    ]
