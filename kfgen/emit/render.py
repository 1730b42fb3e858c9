"""Templates to text."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from kfgen.emit.view import View


@cache
def _template(name: str) -> str:
    """A template's text: package data of an installed kfgen, the folder beside the package in a checkout."""
    packaged = files("kfgen") / "templates" / name
    with as_file(packaged) as path:
        if path.is_file():
            return path.read_text(encoding="utf-8")
    return (Path(__file__).resolve().parents[2] / "templates" / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    return Environment(
        loader=FunctionLoader(_template),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def render(view: View) -> dict[str, str]:
    """File name -> text."""
    environment = _environment()
    return {
        f"{view.name}.{suffix}": _tidy(environment.get_template(f"filter.{suffix}.j2").render(v=view))
        for suffix in ("h", "c")
    }


def _tidy(text: str) -> str:
    """No blanks at line ends, never two empty lines, one newline at the end."""
    out: list[str] = []
    for line in text.split("\n"):
        line = line.rstrip()
        if line or (out and out[-1]):
            out.append(line)
    return "\n".join(out).rstrip("\n") + "\n"
