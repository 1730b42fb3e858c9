"""What a scalar type offers."""

from __future__ import annotations

from contextlib import AbstractContextManager
from fractions import Fraction
from typing import Any, Protocol


class Scalar(Protocol):
    """A number type of the emitted C.

    helpers names the template that defines the static functions `<prefix>_<op>` of the operations that
    `helper_ops` lists; they are emitted only where used.
    """

    name: str
    c_type: str
    size: int  # bytes
    uniform: bool  # whether all elements of an array have one format, so that loops can go through them
    helpers: str
    helper_ops: frozenset[str]
    silent_ops: frozenset[str]  # routines of a fixed-point type that cannot saturate
    epsilon: Fraction  # relative spacing at 1
    smallest: Fraction  # the smallest number whose reciprocal is a number
    probability: Fraction  # the smallest probability of a mode that is not 0; 0 where the type sets no such limit

    def literal(self, value: Fraction) -> str:
        """A constant, rounded once, as C reads it back to the same value."""
        ...

    def nearest(self, value: Fraction) -> Fraction:
        """The representable value nearest to value."""
        ...

    def function(self, op: str) -> str:
        """The libm function of an operation."""
        ...

    def quiet(self) -> AbstractContextManager[object]:
        """In which evaluating says nothing of results that are not finite."""
        ...

    def evaluate(self, op: str, data: Any, args: list[Any]) -> Any:
        """The operation on numbers of this type, as the emitted C computes it."""
        ...

    def convert(self, value: Any) -> Any:
        """A Python number as a number of this type."""
        ...
