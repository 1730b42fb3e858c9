"""Tokens of an expression, and exact decimal numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

from kfgen.spec.problems import short
from kfgen.spec.tree import Number

_MAX_DIGITS = 1_000

_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<op>\*\*|<=|>=|==|!=|//|[-+*/@()\[\],<>])",
    re.ASCII,
)

_PART = re.compile(r"\.([A-Za-z0-9_]+)(?![A-Za-z0-9_(])", re.ASCII)  # not what is called


class ExpressionError(Exception):
    """What is wrong with the text, at which character, and what to write instead."""

    def __init__(self, offset: int, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.offset, self.message, self.hint = offset, message, hint


@dataclass(frozen=True, slots=True)
class Token:
    kind: str  # number, name, op, part (after a dot), end
    text: str
    offset: int


def positions(text: str, name: str) -> list[int]:
    """The offsets of a name in the text of an expression."""
    return [m.start() for m in _TOKEN.finditer(text) if m.lastgroup == "name" and m.group() == name]


def tokenize(text: str) -> list[Token]:
    tokens: list[Token] = []
    i = 0
    while i < len(text):
        if text[i] in " \t\r\n":
            i += 1
            continue
        if (part := _PART.match(text, i)) and _has_parts(tokens, text[i - 1]):
            tokens += [Token("op", ".", i), Token("part", part.group(1), i + 1)]
            i = part.end()
            continue
        match = _TOKEN.match(text, i)
        if match is None:
            raise _bad_character(text, i)
        kind, word = str(match.lastgroup), match.group()
        if kind == "number":
            _check_number_end(text, i, match.end())
        elif word in ("==", "!="):
            hint = "compare with a tolerance: `abs(a - b) < 1e-9`"
            raise ExpressionError(i, f"`{word}` is not allowed", hint)
        elif word == "//":
            raise ExpressionError(i, "`//` is not allowed", "write `floor(a/b)`")
        tokens.append(Token(kind, word, i))
        i = match.end()
    tokens.append(Token("end", "", len(text)))
    return tokens


def _has_parts(tokens: list[Token], before: str) -> bool:
    """Whether a dot is that of a part: v.x, (a + b).x, q[0].x."""
    return bool(tokens) and tokens[-1].text[-1] == before and (tokens[-1].kind == "name" or before in ")]")


def _bad_character(text: str, i: int) -> ExpressionError:
    c = text[i]
    hints = {
        "^": "write `**` for a power", "%": "write `a - b*floor(a/b)`",
        "=": "write `<` or `>`; there is no `==`",
        "&": "write `and`", "|": "write `or`", "!": "write `not`", "~": "write `not`", "×": "write `*`",
        "·": "write `*`", "−": "write `-`", "–": "write `-`", "÷": "write `/`", "²": "write `**2`",
        "π": "write `pi`", "√": "write `sqrt(...)`", "?": "write `where(condition, a, b)`",
        ".": "there are no attributes; write the function's plain name", "{": "use parentheses",
    }  # fmt: skip
    shown = f"`{c}`" if c.isprintable() and not c.isspace() else f"U+{ord(c):04X}"
    hint = hints.get(c, "" if c.isascii() else "expressions are plain ASCII")
    return ExpressionError(i, f"the character {shown} may not stand in an expression", hint)


def _check_number_end(text: str, start: int, end: int) -> None:
    if end >= len(text) or not (text[end].isalnum() or text[end] in "_."):
        return
    tail = re.compile(r"[\w.]*").match(text, start)
    word = tail.group() if tail else text[start : end + 1]
    if re.match(r"0[xXoObB]", word):
        raise ExpressionError(start, f"{short(word)} is not a decimal number", "write it in decimal")
    if "_" in word and re.fullmatch(r"[\d_.eE]+", word):
        hint = f"write {word.replace('_', '')}"
        raise ExpressionError(start, f"the number {short(word)} has underscores", hint)
    if re.fullmatch(r"[\d.]+(?:[eE]\d+)?[jJ]", word):
        raise ExpressionError(start, f"{short(word)} is a complex number", "only real numbers are allowed")
    if text[end] == ".":
        raise ExpressionError(start, f"{short(word)} is not a number")
    if re.match(r"[eE](?:\W|\Z)", text[end:]):
        raise ExpressionError(start, f"{short(word)} has no digits in its exponent")
    if re.fullmatch(r"[\d.]+[kMGmun]", word):
        raise ExpressionError(end, f"{short(word)} has a suffix", "write the power of ten: 1e3")
    hint = f"write `{text[start:end]}*{word[end - start :]}`" if len(word) < 40 else ""
    raise ExpressionError(end, f"an operator is missing in {short(word)}", hint)


def number(text: str, offset: int = 0) -> Number:
    """An exact decimal, bounded to what a double can hold."""
    mantissa, _, exponent = text.lower().partition("e")
    digits = mantissa.replace(".", "").strip("0")
    if len(mantissa) > _MAX_DIGITS or len(exponent) > 12:
        if not digits:
            return Number(Fraction(0))
        raise ExpressionError(offset, f"the number {short(text)} is too long or out of range")
    if not digits:
        return Number(Fraction(0))
    power = int(exponent) if exponent else 0
    leading = len(mantissa.partition(".")[0].lstrip("0")) or (
        len(mantissa.partition(".")[2].lstrip("0")) - len(mantissa.partition(".")[2])
    )
    if not -310 <= power + leading <= 309:
        hint = "use a number between 1e-308 and 1.7e308"
        raise ExpressionError(offset, f"the number {short(text)} is out of range", hint)
    return Number(Fraction(text))
