"""The forms of the covariance by their names: each folder here with a module `form` is one.

`form` has straight(choice), the form in straight-line code, and looped(straight, how), the same in loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib import import_module
from typing import Any

import kfgen.filters.covariance as room
from kfgen.filters.covariance.base import Form, Straight
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.parts import GainChange


@dataclass(frozen=True)
class Choice:
    """What a form is chosen for. n: states. update: of the spec; None: none is chosen, as with sigma points.

    coarse: numbers are of fixed point.
    ordered: gives the cheapest inner order. change: what the spec makes of gains in an inner order.
    """

    n: int
    update: str | None
    epsilon: Fraction
    coarse: bool
    ordered: Callable[[], list[int]]
    change: Callable[[list[int]], GainChange | None]

    @cached_property
    def order(self) -> list[int]:
        """Inner position -> state."""
        return self.ordered()


def straight(name: str, choice: Choice) -> Straight[Any]:
    """The form of a name in straight-line code."""
    made: Straight[Any] = _module(name).straight(choice)
    return made


def looped(name: str, form: Form[Any], how: Looping) -> Form[Any]:
    """The same in loops."""
    made: Form[Any] = _module(name).looped(form, how)
    return made


def _module(name: str) -> Any:
    return import_module(f"{room.__name__}.{name}.form")
