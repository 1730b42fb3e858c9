"""`kfgen doctor`: which tools are here, and what each is for."""

from __future__ import annotations

import json

import click

from kfgen.commands.options import example
from kfgen.commands.tables import Table, show


@click.command(short_help="Which compilers, emulators and extras are here.", epilog=example("kfgen doctor"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def doctor(as_json: bool) -> None:
    """Say which compilers, emulators and extras are here, what each is for, and what installs those that are not.

    Only a C compiler is needed, by `check`, `run` and what else executes a filter; `build` needs none. Exit status 0.
    """
    from kfgen.tools import survey

    found = survey()
    if as_json:
        click.echo(json.dumps([each.as_json() for each in found], indent=2))
        return
    rows = [(t.name, t.version if t.present else "missing", t.purpose, "" if t.present else t.install) for t in found]
    show(Table([("tool", "here", "for", "install"), *rows]))
