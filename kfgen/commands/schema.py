"""`kfgen schema`: the spec language for editors."""

from __future__ import annotations

import click

from kfgen.commands.options import example


@click.command(
    short_help="Print the JSON Schema of the spec language, for editors.",
    epilog=example("kfgen schema > kfgen.schema.json"),
)
def schema() -> None:
    """Print the JSON Schema (2020-12) of the spec language.

    An editor with a YAML language server completes keys and shows what they mean where the first line of a spec is
    `# yaml-language-server: $schema=kfgen.schema.json`, as in those that `kfgen new` writes.
    """
    from kfgen.spec.json_schema import text

    click.echo(text(), nl=False)
