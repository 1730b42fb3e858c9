"""Two headers, item by item: what a program that includes them can see."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_DIRECTIVE = re.compile(r"^[ \t]*#[^\n]*(?:\\\n[^\n]*)*", re.MULTILINE)
_DEFINE = re.compile(r"#\s*define\s+(\w+)(\([^)]*\))?[ \t]*(.*)", re.DOTALL)
_LINKAGE = re.compile(r'extern\s+"C"\s*\{|\}\s*\Z')
_FIELD = re.compile(r"([A-Za-z_]\w*)(?=\[|$)")
_FUNCTION = re.compile(r"(\w+)\s*\(")


@dataclass(frozen=True, order=True)
class Change:
    """An item of a header. before, after: how it is declared; empty where it is not."""

    item: str
    before: str
    after: str

    @property
    def kind(self) -> str:
        return "added" if not self.before else "removed" if not self.after else "changed"


def changes(old: str, new: str, prefix: tuple[str, str] | None = None) -> list[Change]:
    """What differs between two headers, in the order of the old one, then of the new one.

    prefix: the names of the two filters, where these are to count as one.
    """
    before, after = items(old if prefix is None else _renamed(old, *prefix)), items(new)
    names = [*before, *(name for name in after if name not in before)]
    found = [Change(name, before.get(name, ""), after.get(name, "")) for name in names]
    return [each for each in found if each.before != each.after]


def _renamed(header: str, old: str, new: str) -> str:
    for before, after in ((old, new), (old.upper(), new.upper())):
        header = re.sub(rf"\b{before}_", f"{after}_", header)
    return header


def items(header: str) -> Mapping[str, str]:
    """Name -> declaration of each macro, type, index, field (with its place) and function, without comments, layout."""
    text = _COMMENT.sub(" ", header)
    found: dict[str, str] = {}
    for line in _DIRECTIVE.findall(text):
        define = _DEFINE.match(line.strip())
        if define and not define.group(1).endswith("_H_INCLUDED"):
            name, arguments, value = define.groups()
            found[name] = f"#define {name}{arguments or ''} {_flat(value)}".rstrip()
    for declaration in _declarations(_LINKAGE.sub(" ", _DIRECTIVE.sub(" ", text))):
        found |= _named(declaration)
    return found


def _flat(text: str) -> str:
    return " ".join(text.replace("\\\n", " ").split())


def _declarations(text: str) -> Iterator[str]:
    """The pieces between semicolons outside of braces."""
    depth, start = 0, 0
    for at, letter in enumerate(text):
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == ";" and depth == 0:
            yield _flat(text[start:at])
            start = at + 1


def _named(declaration: str) -> Mapping[str, str]:
    """An index for each name of an enumeration, an item for each field of a struct and for its order, one otherwise."""
    head, brace, rest = declaration.partition("{")
    if not brace:
        function = _FUNCTION.search(declaration)
        return {function.group(1) if function else declaration.split()[-1]: declaration} if declaration else {}
    body, _, name = rest.rpartition("}")
    if head.split()[0] == "enum":
        entries = [each.strip() for each in body.split(",") if each.strip()]
        return {entry.split()[0]: f"{entry} = {i}" for i, entry in enumerate(entries)}
    of = name.strip() or head.split()[-1]
    fields = [field.strip() for field in body.split(";") if field.strip()]
    return {f"{of}.{_FIELD.findall(each)[-1]}": f"{of}: {each} [{i}]" for i, each in enumerate(fields)}
