"""A value with its derivatives by the variables of the moment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeVar

from kfgen.filters.algebra.numbers import is_zero
from kfgen.ir.trace import Number, Value

Key = TypeVar("Key")
Gradient = dict[str, Value]  # variable name -> derivative; what is not there is 0
Hessian = dict[tuple[str, str], Value]  # pair of variables in alphabetical order -> second derivative


@dataclass(frozen=True)
class Dual:
    """A value and its derivatives by the variables of the moment (errors of states, noises); second ones where asked
    for."""

    value: Value
    gradient: Gradient = field(default_factory=dict)
    hessian: Hessian = field(default_factory=dict)
    attitude: Any = None  # the Attitude that this is a number of

    def __add__(self, other: Dual) -> Dual:
        return Dual(
            self.value + other.value, _sum(self.gradient, other.gradient), _sum(self.hessian, other.hessian)
        )

    def scaled(self, factor: Value | Number) -> Dual:
        """The product with a number that depends on no variable."""
        return Dual(self.value * factor, _scaled(self.gradient, factor), _scaled(self.hessian, factor))


def _sum(a: dict[Key, Value], b: dict[Key, Value]) -> dict[Key, Value]:
    out = dict(a)
    for key, value in b.items():
        out[key] = out[key] + value if key in out else value
    return nonzero(out)


def _scaled(a: dict[Key, Value], factor: Value | Number) -> dict[Key, Value]:
    return nonzero({key: value * factor for key, value in a.items()})


def nonzero(values: dict[Key, Value]) -> dict[Key, Value]:
    return {key: value for key, value in values.items() if not is_zero(value)}
