"""Arguments and options that several commands share."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kfgen.errors import KfgenError
from kfgen.scalar_names import is_fixed

if TYPE_CHECKING:
    from kfgen.generate import Generated
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


any_rate_option = click.option(
    "--any-rate", is_flag=True, help="With a fixed dt: take a log whose steps are others all the same."
)


columns_option = click.option(
    "--columns", "renamed", type=click.Path(path_type=Path), metavar="FILE.yaml",
    help="Names and units of a foreign log: `t: {from: time_ms, scale: 1e-3}`.",
)  # fmt: skip


def log_of(path: Path, spec: Spec, any_rate: bool, renamed: Path | None = None) -> Log:
    """The log of a file (`-`: of standard input), whose rate has to fit a fixed dt; it tells of ignored columns, and of
    an unusual form. renamed: a file that maps names and units."""
    from kfgen import logs
    from kfgen.columns import load_columns
    from kfgen.native.run import fixed_step

    data = logs.read(path, spec, None if renamed is None else load_columns(renamed))
    for said in data.said:
        click.echo(f"kfgen: {data.source}: {said}", err=True)
    if data.ignored:
        click.echo(f"kfgen: ignored columns of {data.source}: {logs.listed(data.ignored)}", err=True)
    if fixed_step(spec) and not any_rate:
        logs.check_rate(data, fixed_step(spec))
    return data


quiet_option = click.option("--quiet", is_flag=True, help="No advice on what a spec may not mean.")


def tell_advice(spec: Spec, generated: Generated | None = None) -> None:
    """What a spec may hold, but probably does not mean, on stderr: a line each. generated: judge its costs too."""
    from kfgen.advice import advise

    for each in advise(spec, generated):
        click.echo(str(each), err=True)


def load_spec(path: Path, scalar: str | None = None) -> Spec:
    """The spec of a file, with another scalar where one is asked for."""
    from kfgen.override import override
    from kfgen.spec import load

    return override(load(path), scalar)


def keep_apart(read: Mapping[str, Path], written: Mapping[str, Path | None]) -> None:
    """KfgenError where a command would write over what it reads, or write two things to one file. By what they are."""
    known = list(read.items())
    for option, path in written.items():
        if path is None:
            continue
        for what, other in known:
            if _same(path, other):
                raise KfgenError(f"{path}: {option} would overwrite {what}; name another file")
        known.append((f"what {option} writes", path))


def _same(a: Path, b: Path) -> bool:
    """Whether two paths lead to one file, by whatever links; what is no file (/dev/null) is never one."""
    if a.exists() and b.exists():
        return a.is_file() and a.samefile(b)
    return os.path.realpath(a) == os.path.realpath(b)


def example(*lines: str) -> str:
    """An epilog with examples, each on a line of its own."""
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in lines)
