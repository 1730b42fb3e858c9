"""What round-off may not do to a full covariance: how updates round, and what of their results is tested.

P - c c^T / s loses all digits of a variance where s is far above r, and what is left may be anything within a few
units in the last place of what it was: negative, or 0, so that nothing is learnt of the state any more. Hence 1 / s is
rounded down by `UNITS` of them. In Joseph's form, which takes back what rounding does to a state that is measured
itself, r is rounded up by as many of s in the other variances. What is left then is not less than rounding; what is
negative all the same is settled once it is stored, see `kernels.correlations`.
"""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_constant,
    is_nonnegative,
    is_positive,
    is_zero,
    reciprocal,
    select,
)  # fmt: skip
from kfgen.ir.trace import Value

UNITS = 4  # in the last place


def inverse_of(s: Value, r: Number, epsilon: Fraction) -> tuple[Value, Value]:
    """1 / s rounded down, for s = r + something not negative; and the same, 0 where s is 0. As it is where r is 0:
    a measurement without noise says what it says."""
    low = 1 - UNITS * epsilon
    if is_positive(r) and not _chosen(r):
        inverse = low / s
        return inverse, inverse
    inverse = (1 if is_zero(r) else select(r > 0, low, 1)) / s
    return inverse, inverse if is_positive(r) else select(reciprocal(s)[0], inverse, 0)


def lifting(s: Value, r: Number) -> Number:
    """s, of which units come to r; nothing where r is 0."""
    if is_zero(r):
        return 0
    return s if is_positive(r) and not _chosen(r) else select(r > 0, s, 0)


def _chosen(r: Number) -> bool:
    """Whether a variance is 0 unless a floor has raised it."""
    return isinstance(r, Value) and r.node.op == "select"


def not_negative(spread: Number) -> Number:
    """h P h^T, which below zero is rounding and counts as zero."""
    return spread if is_nonnegative(spread) else assume_nonnegative(select(spread < 0, 0, spread))


def is_stored(p: Number) -> bool:
    """Whether a number is one of the struct."""
    return isinstance(p, Value) and p.node.op == "element"


def settled(p: Number) -> bool:
    """Whether a variance is one of the struct, or a constant more that is far from the end of any range."""
    if isinstance(p, Value) and p.node.op == "add":
        a, b = p.node.args
        return a.op == "element" and b.constant is not None and 0 <= b.constant < 10**20
    return is_stored(p)


def spoilt_by(s: Value, r: Number) -> Value:
    """Whether h P h^T is negative by more than a half of r: what rounding has left of P is then no covariance."""
    half: Value = s < r * Fraction(1, 2) if is_constant(r) else s + s < r
    return half


def single_state(h: Vector) -> int:
    """The state that a row measures by a constant, if it is a single one; else -1."""
    seen = [j for j, x in enumerate(h) if not is_zero(x)]
    return seen[0] if len(seen) == 1 and is_constant(h[seen[0]]) else -1
