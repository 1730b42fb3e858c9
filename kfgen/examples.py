"""The example specs, which an installed kfgen has with it: to start a spec of one's own from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from kfgen.errors import KfgenError

SCHEMA = "kfgen.schema.json"
MODELINE = f"# yaml-language-server: $schema={SCHEMA}\n"
_FIELD = r"^{}: *(.*?) *(?:#.*)?$"


@cache
def examples() -> Mapping[str, str]:
    """Name -> text of each example: package data of an installed kfgen, the folder beside the package in a checkout."""
    with as_file(files("kfgen") / "specs") as packaged:
        folder = packaged if packaged.is_dir() else Path(__file__).resolve().parents[1] / "specs"
        return {path.stem: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.yaml"))}


def description(text: str) -> str:
    """What a spec says of itself."""
    found = re.search(_FIELD.format("description"), text, re.MULTILINE)
    return found.group(1) if found else ""


def like(example: str, name: str) -> str:
    """A spec called `name` that is an example otherwise, comments and all. KfgenError names a close example."""
    text = examples().get(example)
    if text is None:
        close = get_close_matches(example, examples(), 1)
        hint = f"did you mean `{close[0]}`?" if close else f"there are {', '.join(examples())}"
        raise KfgenError(f"there is no example `{example}`; {hint}")
    renamed = re.sub(_FIELD.format("name"), f"name: {name}", text, count=1, flags=re.MULTILINE)
    return MODELINE + renamed
