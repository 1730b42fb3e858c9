"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from kfgen.spec.types import Spec

spec_argument = click.argument("spec", type=click.Path(path_type=Path), metavar="SPEC")
scalar_option = click.option(
    "--scalar",
    metavar="S",
    help="float, double or q<m>.<n> (such as q16.16) in place of the spec's own scalar.",
)


def load_spec(path: Path, scalar: str | None = None) -> Spec:
    """The spec of a file, with another scalar where one is asked for."""
    from kfgen.override import override
    from kfgen.spec import load

    return override(load(path), scalar)


def example(*lines: str) -> str:
    """An epilog with examples, each on a line of its own."""
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in lines)
