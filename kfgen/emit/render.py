"""Templates to text."""

from __future__ import annotations

import textwrap
from functools import cache
from typing import Any

from jinja2 import DictLoader, Environment, StrictUndefined

from kfgen.emit.data import View
from kfgen.emit.history import HistoryView
from kfgen.emit.text import WIDTH
from kfgen.packaged import texts

_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=DictLoader(texts("templates")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters |= {"u32": "UINT32_C({})".format, "i64": "INT64_C({})".format}
    return environment


def render(view: View) -> dict[str, str]:
    """File name -> text."""
    return {f"{view.name}.{suffix}": render_c(f"c/filter.{suffix}.j2", v=view) for suffix in ("h", "c")}


def render_history(view: View, history: HistoryView) -> dict[str, str]:
    """File name -> text of the history around a filter."""
    return {
        f"{view.name}_history.{suffix}": render_c(f"c/history.{suffix}.j2", v=view, h=history) for suffix in ("h", "c")
    }


def render_c(template: str, **names: Any) -> str:
    """The C text of a template."""
    return _tidy(render_text(template, **names))


def render_text(template: str, **names: Any) -> str:
    """The text of a template as it stands, for what is not C."""
    return _environment().get_template(template).render(**names)


def macro(template: str, name: str, *arguments: Any, **options: Any) -> str:
    """What one macro of a template file gives."""
    return _tidy(str(getattr(_environment().get_template(template).module, name)(*arguments, **options)))


def _tidy(text: str) -> str:
    """No line beyond the width for a comment's sake, no blanks at line ends, never two empty lines."""
    out: list[str] = []
    for line in text.split("\n"):
        for part in _narrow(line.rstrip()):
            if part or (out and out[-1]):
                out.append(part)
    return "\n".join(out).rstrip("\n") + "\n"


def _narrow(line: str) -> list[str]:
    """A line as it is, or, where a comment makes it too long, in several: one that trails code goes above it."""
    if len(line) <= WIDTH:
        return [line]
    if line.startswith(" * "):
        body = line[3:]
        indent = " " * (len(body) - len(body.lstrip()))
        first = textwrap.wrap(body, WIDTH - 3, subsequent_indent=indent + "    ", **_WORDS)
        return [" * " + part for part in first]
    code, mark, comment = line.partition(" /* ")
    if mark and comment.endswith(" */") and code.strip():
        indent = " " * (len(code) - len(code.lstrip()))
        words = textwrap.wrap(comment.removesuffix(" */"), WIDTH - len(indent) - 6, **_WORDS)
        above = [f"{indent}{'/*' if i == 0 else '  '} {part}" for i, part in enumerate(words)]
        return [*above[:-1], above[-1] + " */", code.rstrip()]
    return [line]
