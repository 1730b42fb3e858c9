"""What a spec declares of a quantity, as floats."""

from __future__ import annotations

from kfgen.spec.constants import value
from kfgen.spec.tree import Expression
from kfgen.spec.types import Range, Spec


def number(expression: Expression, spec: Spec) -> float:
    """A constant expression. NotConstant or NoValue where it has no value."""
    return float(value(expression.tree, spec))


def limits(declared: Range, spec: Spec) -> tuple[float, float]:
    """The lower and the upper end of a range."""
    low, high = declared
    return number(low, spec), number(high, spec)
