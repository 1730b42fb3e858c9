"""One part of a state or of a measurement, and what it belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Protocol

from kfgen.geometry.circle import Circle
from kfgen.geometry.line import Line


class Part(Protocol):
    """The geometry of one part.

    dimension: of its error. flat: a - b is a [-] b, however far apart they are, so that any point will do as the base
    of a mean.
    """

    @property
    def dimension(self) -> int: ...

    @property
    def flat(self) -> bool: ...

    def placed(self, x: Any) -> Any:
        """x as it is stored, in its chart."""
        ...

    def retract(self, x: Any, d: Any) -> Any:
        """x [+] d."""
        ...

    def local(self, a: Any, b: Any) -> Any:
        """a [-] b: the d with b [+] d = a."""
        ...


def part_of(period: Fraction | float | None) -> Part:
    """A number, or one that repeats after a period."""
    return Line() if period is None else Circle(period)


def heaviest(values: Sequence[Any], weights: Sequence[Any], select: Any) -> Any:
    """The base about which values that are not flat are averaged: that of the largest weight, the first of equals.

    select(condition, a, b): a where the condition holds.
    """
    value, weight = values[0], weights[0]
    for v, w in zip(values[1:], weights[1:], strict=True):
        value, weight = select(w > weight, v, value), select(w > weight, w, weight)
    return value
