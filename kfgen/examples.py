"""The example specs, which an installed kfgen has with it: to start a spec of one's own from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache

from kfgen.errors import KfgenError
from kfgen.packaged import texts

SCHEMA = "kfgen.schema.json"
MODELINE = f"# yaml-language-server: $schema={SCHEMA}\n"
_FIELD = r"^{}: *(.*?) *(?:#.*)?$"


@cache
def examples() -> Mapping[str, str]:
    """Name -> text of each example."""
    return {name.removesuffix(".yaml"): text for name, text in texts("specs").items() if name.endswith(".yaml")}


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
