"""The names of the scalar types: float, double and, for fixed point, q<m>.<n>."""

from __future__ import annotations

import re

FLOAT, DOUBLE = "float", "double"

RULE = "m + n = 32 and 8 <= n <= 24"
KNOWN = f"write {FLOAT}, {DOUBLE} or q<m>.<n> with {RULE}, such as q16.16"
"""What to write, for messages."""

_Q = re.compile(r"q([1-9]\d?)\.([1-9]\d?)", re.ASCII)


def is_scalar(name: str) -> bool:
    """float, double or a q<m>.<n> within the rule."""
    if is_floating(name):
        return True
    match = _Q.fullmatch(name)
    return match is not None and 8 <= int(match[2]) <= 24 and int(match[1]) + int(match[2]) == 32


def is_floating(name: str) -> bool:
    return name in (FLOAT, DOUBLE)


def is_fixed(name: str) -> bool:
    """Whether a scalar's name is one of fixed point."""
    return not is_floating(name)
