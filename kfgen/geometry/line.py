"""The line: a number that is nothing but a number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Line:
    """x [+] d = x + d and a [-] b = a - b; all their derivatives are 1."""

    dimension = 1
    flat = True

    def placed(self, x: Any) -> Any:
        return x

    def retract(self, x: Any, d: Any) -> Any:
        return x + d

    def local(self, a: Any, b: Any) -> Any:
        return a - b
