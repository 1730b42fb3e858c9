"""New numbers in the text of a spec: nothing else of it changes, not a blank, not a comment."""

from __future__ import annotations

import re
from collections.abc import Sequence

from kfgen.tuning.numbers import Slot

DIGITS = 6

_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def rounded(number: float) -> float:
    """A number as it is written."""
    return float(f"{number:.{DIGITS}g}")


def spelled(number: float) -> str:
    """A number as YAML 1.2 and every reader of it take it for one."""
    mantissa, e, exponent = f"{number:.{DIGITS}g}".partition("e")
    if not e:
        return mantissa
    return f"{mantissa}{'' if '.' in mantissa else '.0'}e{int(exponent):+d}"


def with_numbers(text: str, slots: Sequence[Slot], values: Sequence[float]) -> str:
    """The text of a spec with new values in its slots."""
    starts = [0, *(match.end() for match in re.finditer(r"\r\n|\r|\n", text))]
    mark = 1 if text.startswith("\ufeff") else 0
    changes = []
    for slot, number in zip(slots, values, strict=True):
        if number == slot.value:
            continue
        for place, literal in slot.spots:
            first = starts[place.line - 1] + place.column - 1 + (mark if place.line == 1 else 0)
            changes.append((*_span(text, first, literal), spelled(number)))
    for begin, end, new in sorted(changes, reverse=True):
        text = text[:begin] + new + text[end:]
    return text


def _span(text: str, first: int, literal: int | None) -> tuple[int, int]:
    """Where the number stands; the scalar begins at `first`."""
    if literal is not None:
        return [*_NUMBER.finditer(text, first, first + 10_000)][literal].span()
    quote = text[first] if text[first] in "'\"" else ""
    if quote:
        return first, text.index(quote, first + 1) + 1
    plain = re.compile(r"[-+]?[^\s,\]}#:][^,\]}\n\r]*")
    match = plain.match(text, first)
    assert match is not None
    content = re.split(r"\s+#", match.group())[0].rstrip()
    return first, first + len(content)
