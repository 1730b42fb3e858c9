"""The errors kfgen raises for what its user wrote, and the one place that formats them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Place:
    """Where something stands in a spec: file, 1-based line and column, and key path (`states.px.std`)."""

    file: str = "<spec>"
    line: int = 0
    column: int = 0
    path: str = ""


NOWHERE = Place()


@dataclass(frozen=True, order=True)
class Mistake:
    """One mistake of a spec: where, what is wrong, and what to write instead."""

    place: Place
    message: str
    hint: str = ""

    def __str__(self) -> str:
        place = self.place
        text = f"{place.file}:{place.line}:{place.column}: "
        if place.path:
            text += f"{place.path}: "
        return text + self.message + (f"; {self.hint}" if self.hint else "")


@dataclass(frozen=True, order=True)
class Advice:
    """What is allowed but probably not meant: where, what, a cure, and the name by which a spec silences it."""

    place: Place
    message: str
    hint: str
    name: str

    def __str__(self) -> str:
        place = self.place
        at = f"{place.file}:{place.line}:{place.column}: warning: " + (f"{place.path}: " if place.path else "")
        return f"{at}{self.message}; {self.hint} [{self.name}]"


class KfgenError(Exception):
    """What kfgen tells its user without a traceback; the command line exits with status 2."""


class SpecError(KfgenError):
    """All mistakes found in a spec, in the order of their lines; `str` gives one line per mistake."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes: tuple[Mistake, ...] = tuple(sorted(set(mistakes)))
        super().__init__("\n".join(str(mistake) for mistake in self.mistakes))

    @classmethod
    def at(cls, place: Place, message: str, hint: str = "") -> SpecError:
        """A SpecError of a single mistake."""
        return cls([Mistake(place, message, hint)])
