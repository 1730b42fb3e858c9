"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from kfgen.scalar_names import is_fixed

if TYPE_CHECKING:
    from kfgen.logs import Log
    from kfgen.spec.types import Spec

spec_argument = click.argument("spec", type=click.Path(path_type=Path), metavar="SPEC")
scalar_option = click.option(
    "--scalar",
    metavar="S",
    help="float, double or q<m>.<n> (such as q16.16) in place of the spec's own scalar.",
)
ranges_option = click.option(
    "--ranges", "ranges", type=click.Path(path_type=Path), metavar="LOG.csv",
    help="The log that `kfgen build --log` was given, whose ranges a fixed-point filter holds.",
)  # fmt: skip


def read_ranges(path: Path | None, spec: Spec) -> Log | None:
    """The log that fixed point takes ranges from; other scalars have no use for one."""
    if path is None or not is_fixed(spec.scalar):
        return None
    from kfgen.logs import read

    return read(path, spec)


def load_spec(path: Path, scalar: str | None = None) -> Spec:
    """The spec of a file, with another scalar where one is asked for."""
    from kfgen.override import override
    from kfgen.spec import load

    return override(load(path), scalar)


def example(*lines: str) -> str:
    """An epilog with examples, each on a line of its own."""
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in lines)
