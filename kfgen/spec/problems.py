"""Collecting mistakes: reading goes on after each one, so that one run lists them all."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable

from kfgen.errors import Mistake, Place, SpecError

SHARED_STATES = "all modes share `states`; give a mode the full list and leave unused ones constant"
LIMIT = 200  # more lines than this help nobody, and a hostile file must not fill the terminal


class Problems:
    """The mistakes found so far."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.mistakes: dict[Mistake, None] = {}  # a dict: in order, each once

    def add(self, place: Place, message: str, hint: str = "") -> None:
        self.mistakes.setdefault(Mistake(place, printable(message), printable(hint)))

    def at(self, line: int, column: int, path: str = "") -> Place:
        return Place(self.file, line, column, printable(path))

    def stop(self, place: Place, message: str, hint: str = "") -> SpecError:
        """The error to raise where reading cannot go on; it keeps what was found before."""
        self.add(place, message, hint)
        return self.error()

    def error(self) -> SpecError:
        listed = sorted(self.mistakes)
        left = len(listed) - LIMIT
        if left > 0:
            more = Mistake(listed[LIMIT].place, f"{left} more mistakes follow", "correct the others first")
            listed = [*listed[:LIMIT], more]
        return SpecError(listed)


def printable(text: str) -> str:
    """Text for one line of a message: no line breaks, no control characters, of bounded length."""
    text = "".join(c if c.isprintable() else " " for c in text)
    return text if len(text) <= 400 else text[:397] + "..."


def unseen(text: str) -> str | None:
    """The first character of a text that a reader cannot see: a control or format character (one of those that turn the
    direction of writing makes a comment look like code), a line separator of Unicode, half a surrogate pair."""
    odd = (c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") and c not in "\n\r\t")
    return next(odd, None)


def short(text: str, limit: int = 40) -> str:
    """What the user wrote, quoted and shortened for a message."""
    text = printable(text)
    return f"`{text if len(text) <= limit else text[: limit - 3] + '...'}`"


def suggestion(word: str, known: Iterable[str]) -> str | None:
    """The known word that was probably meant."""
    known = list(known)
    by_fold = {k.casefold(): k for k in reversed(known)}
    if word.casefold() in by_fold:
        return by_fold[word.casefold()]
    close = difflib.get_close_matches(word[:60], known, n=1, cutoff=0.6)
    return close[0] if close else None


def did_you_mean(word: str, known: Iterable[str], what: str = "") -> str:
    """A hint: the nearest known word, or, where none is near, what there is."""
    known = list(known)
    close = suggestion(word, known)
    if close is not None:
        return f"did you mean `{close}`?"
    if known and len(known) <= 12:
        return (what or "known here") + ": " + ", ".join(known)
    return ""
