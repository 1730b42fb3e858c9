"""A foreign log's columns: which is which, and in what unit (`t: {from: time_ms, scale: 1e-3}`)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from kfgen.errors import SpecError
from kfgen.spec import nodes
from kfgen.spec.problems import Problems, did_you_mean
from kfgen.spec.reader import read

KEYS = ("from", "scale", "offset")


@dataclass(frozen=True)
class Origin:
    """Where a column comes from: `name` in the log, times scale, plus offset."""

    name: str
    scale: float = 1.0
    offset: float = 0.0


Columns = Mapping[str, Origin]
"""Name of a column as kfgen has it -> where it comes from; all others keep their names."""


def load_columns(path: str | os.PathLike[str]) -> dict[str, Origin]:
    """The columns that a YAML file maps: NAME: {from: OTHER, scale: NUMBER, offset: NUMBER}, or NAME: OTHER.

    SpecError lists every mistake with its place; OSError where the file cannot be read.
    """
    problems = Problems(os.fspath(path))
    root = read(Path(path).read_text(encoding="utf-8-sig"), problems)
    found: dict[str, Origin] = {}
    if not isinstance(root, nodes.Mapping):
        raise problems.stop(
            problems.at(root.line, root.column), "columns are a mapping", "write `t: {from: time_ms, scale: 1e-3}`"
        )
    for key, value in root.items:
        origin = _origin(key, value, problems)
        if origin is not None:
            found[key.text] = origin
    if problems.mistakes:
        raise SpecError(problems.mistakes)
    return found


def _origin(key: nodes.Scalar, value: nodes.Node, problems: Problems) -> Origin | None:
    at = problems.at(value.line, value.column, key.text)
    if isinstance(value, nodes.Scalar) and value.text:
        return Origin(value.text)
    if not isinstance(value, nodes.Mapping):
        problems.add(
            at, f"a column comes from another, not from {nodes.kind_of(value)}", "write {from: NAME, scale: 1e-3}"
        )
        return None
    name, numbers = key.text, {"scale": 1.0, "offset": 0.0}
    for entry, given in value.items:
        place = problems.at(given.line, given.column, f"{key.text}.{entry.text}")
        text = given.text if isinstance(given, nodes.Scalar) else ""
        if entry.text not in KEYS:
            problems.add(place, f"unknown key `{entry.text}`", did_you_mean(entry.text, KEYS))
        elif entry.text == "from":
            name = text
        elif isinstance(given, nodes.Scalar) and given.kind == "number":
            numbers[entry.text] = float(text)
        else:
            problems.add(place, f"`{entry.text}` is a number, not {nodes.kind_of(given)}")
    if not name:
        problems.add(at, "`from` names a column", "write the name that the log has")
        return None
    return Origin(name, **numbers)
