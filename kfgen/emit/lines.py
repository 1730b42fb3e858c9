"""C broken into lines of at most WIDTH columns."""

from __future__ import annotations

from kfgen.emit.text import WIDTH


def wrapped(text: str, depth: int) -> list[str]:
    """A statement in lines of at most WIDTH columns, broken before the outermost operator that fits."""
    indent = "    " * depth
    lines: list[str] = []
    rest = indent + text
    while len(rest) > WIDTH:
        cut = _break(rest, len(indent) + (4 if lines else 0))
        if cut is None:
            break
        lines.append(rest[:cut].rstrip())
        rest = indent + "    " + rest[cut:].lstrip()
    return [*lines, rest]


def _break(text: str, start: int) -> int | None:
    """Where to break a line: at the space of least parenthesis depth in the last two thirds, the last of those.

    Where there is none, at the last one before, or else behind a parenthesis.
    """
    best: tuple[int, int] | None = None
    early: int | None = None
    opened: int | None = None
    level = 0
    in_product = 0
    for i, c in enumerate(text[: WIDTH + 1]):
        if c in "([":
            level += 1
            opened = i + 1 if c == "(" and start < i < WIDTH - 1 else opened
        elif c in ")]":
            level -= 1
        elif c == " " and i > start:
            following = text[i + 1 : i + 2]
            if following in "+-?:|&" or text[i - 1] in ",=":
                in_product = 0
            elif following in "*/":
                in_product = 1
            else:
                continue
            if i <= start + (WIDTH - start) // 3:
                early = i
                continue
            score = -(2 * level + in_product)
            if best is None or score >= best[0]:
                best = (score, i)
    return best[1] if best is not None else opened if early is None else early
