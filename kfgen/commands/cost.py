"""`kfgen cost`: what a filter costs on a microcontroller."""

from __future__ import annotations

from pathlib import Path

import click

from kfgen.commands.options import example, spec_argument
from kfgen.errors import KfgenError


@click.command(
    short_help="Measure instructions, flash, RAM and stack (not built yet).",
    epilog=example("kfgen cost specs/vehicle.yaml --target cortex-m4f"),
)
@spec_argument
@click.option("--target", metavar="T", help="The microcontroller to compile and emulate for.")
@click.option("--log", type=click.Path(path_type=Path), metavar="LOG", help="The log to run.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def cost(spec: Path, target: str | None, log: Path | None, as_json: bool) -> None:
    """Cross-compile a filter, emulate it, print instructions, flash, RAM and stack.

    Not built yet in this version: it ends with an error.
    """
    raise KfgenError("cost is not built yet in this version")
