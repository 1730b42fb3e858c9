"""The page of a report: HTML with everything in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from kfgen import __version__
from kfgen.packaged import texts
from kfgen.report.blocks import Block, Note, Picture, Section
from kfgen.report.subject import Subject


@dataclass(frozen=True)
class Drawn:
    """A picture whose SVG is not to be escaped."""

    svg: Markup
    caption: str
    kind: str = "picture"


@dataclass(frozen=True)
class Group:
    """Blocks in a row that are of one kind: pictures stand beside each other."""

    kind: str
    blocks: Sequence[Block | Drawn]


@dataclass(frozen=True)
class Placed:
    """A section as the page has it."""

    title: str
    groups: Sequence[Group]


@dataclass(frozen=True)
class Page:
    """What the template sees."""

    name: str
    description: str
    version: str
    facts: Sequence[tuple[str, str]]
    verdicts: Sequence[tuple[str, str]]
    sections: Sequence[Placed]


def page(subject: Subject, sections: Sequence[Section]) -> str:
    """The HTML text."""
    spec = subject.spec
    facts = [
        ("filter", subject.generated.code.description),
        ("scalar", spec.scalar),
        ("states, inputs, sensors", f"{len(spec.states)}, {len(spec.inputs)}, {len(spec.measurements)}"),
        ("logs", ", ".join(drive.title for drive in subject.drives) or "none"),
        ("SHA-256 of the spec", spec.sha256[:16] + "…"),
    ]
    verdicts = [(b.text, b.tone) for s in sections for b in s.blocks if isinstance(b, Note) and b.tone != "plain"]
    placed = [Placed(each.title, _grouped(each.blocks)) for each in sections]
    view = Page(spec.name, spec.description, __version__, facts, verdicts, placed)
    return _environment().get_template("report/page.html.j2").render(p=view)


def _grouped(blocks: Sequence[Block]) -> list[Group]:
    shown: list[Block | Drawn] = [
        Drawn(Markup(each.svg), each.caption) if isinstance(each, Picture) else each for each in blocks
    ]
    runs = groupby(shown, lambda each: isinstance(each, Drawn))
    return [Group("picture" if drawn else "other", list(some)) for drawn, some in runs]


@cache
def _environment() -> Environment:
    """Everything is escaped but what is marked as SVG or MathML of kfgen's own making."""
    return Environment(
        loader=DictLoader(texts("templates")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
