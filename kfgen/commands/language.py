"""`kfgen language`: the reference of the spec language."""

from __future__ import annotations

import click

from kfgen.commands.options import example


@click.command(short_help="Print the reference of the spec language.", epilog=example("kfgen language > language.md"))
def language() -> None:
    """Print the reference of the spec language as Markdown."""
    from kfgen.spec.reference import markdown

    click.echo(markdown())
