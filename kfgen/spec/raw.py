"""What a spec's nodes become before the dataclasses: checked values under their keys, with places.

A value whose mistake has been reported is None, a formula `BAD`; both stay silent from then on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from kfgen.errors import Place
from kfgen.spec.tree import Expression, Name
from kfgen.spec.types import Matrix, Range

BAD = Name("")  # the tree of a formula whose mistake has been reported
Path = tuple[str, ...]


@dataclass(frozen=True)
class Word:
    """The name of something declared elsewhere, as written."""

    text: str
    place: Place


@dataclass(frozen=True)
class Written:
    """A formula as it stands in the file: what may stand in it, and under which keys it is."""

    expression: Expression  # as it was parsed; of a vector or a list every entry
    scope: str
    path: Path
    parts: tuple[Expression, ...] = ()  # of numbers, once the shapes are known


@dataclass(frozen=True)
class Listed:
    """A list of YAML where a formula stands: a vector, or the rows of a matrix."""

    items: tuple[Expression | Listed, ...]
    place: Place


Formulas = Expression | Listed


@dataclass
class Fields:
    """What was written under the keys of a record, or the entries of a table."""

    place: Place  # of the key that holds it
    path: Path = ()
    values: dict[str, Any] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)  # of the keys
    bad: bool = False  # it was no mapping: nothing is missing from it

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str, default: Any = None) -> Any:
        """The value, or the default where it is missing or its mistake has been reported."""
        value = self.values.get(key)
        return default if value is None else value

    def at(self, key: str) -> Place:
        return self.places.get(key, self.place)


def entries(written: Any) -> list[tuple[str, Any]]:
    """The entries of a table that could be read."""
    if not isinstance(written, Fields):
        return []
    return [(name, entry) for name, entry in written.values.items() if entry is not None]


def limits(fields: Fields, key: str) -> Range | None:
    found = fields.get(key)
    return (found[0], found[1]) if found is not None else None


def matrix(written: Any) -> Matrix | None:
    """A matrix all of whose rows could be read."""
    if not isinstance(written, tuple) or any(row is None for row in written):
        return None
    return written


def path_text(path: Path) -> str:
    """`states.px.std`, `P0[0][1]`."""
    return "".join(part if part.startswith("[") else f".{part}" for part in path).lstrip(".")
