"""`kfgen new`: a spec to start from."""

from __future__ import annotations

from pathlib import Path

import click

from kfgen.commands.options import example
from kfgen.commands.tables import Paths, Table, show
from kfgen.errors import KfgenError, SpecError


def _list(ctx: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    if not wanted:
        return
    from kfgen.examples import description, examples

    show(Table([("example", "shows"), *((name, description(text)) for name, text in examples().items())]))
    ctx.exit()


@click.command(
    short_help="Write a commented spec to start from.",
    epilog=example("kfgen new --list", "kfgen new pump --like scalar", "kfgen new drone --like ahrs"),
)
@click.argument("name")
@click.option("--like", metavar="EXAMPLE", default="scalar", show_default=True, help="The example to start from.")
@click.option(
    "--list", is_flag=True, is_eager=True, expose_value=False, callback=_list, help="Print what each example shows."
)
def new(name: str, like: str) -> None:
    """Write NAME.yaml: an example under a name of its own, with its comments. It builds, checks and runs at once.

    Beside it kfgen.schema.json, which the first line of the spec names: with it an editor that has a YAML language
    server completes keys and says what they mean.
    """
    from kfgen.examples import SCHEMA
    from kfgen.examples import like as copy
    from kfgen.files import write_all
    from kfgen.spec import loads
    from kfgen.spec.json_schema import text as schema

    path, beside = Path(f"{name}.yaml"), Path(SCHEMA)
    text = copy(like, name)
    try:
        loads(text, str(path))
    except SpecError as error:  # of the name: there is no file yet to point into
        raise KfgenError("\n".join(f"{each.message}; {each.hint}" for each in error.mistakes)) from None
    if path.exists():
        raise KfgenError(f"{path} exists; choose another name, or move it away")
    files: dict[Path, str | bytes] = {path: text}
    if not beside.exists() or "kfgen schema" in beside.read_text(encoding="utf-8", errors="replace")[:400]:
        files[beside] = schema()
    write_all(files)
    show(Paths([str(each) for each in files]), f"Next: kfgen build {path}; kfgen check {path}")
