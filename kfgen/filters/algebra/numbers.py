"""What linear algebra asks of its numbers, for traced Values and for Python numbers alike.

Structural facts (this is zero, this is positive) are known of a traced number when its program is made;
of a Python number they are simply looked at.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from kfgen.ir.nodes import Node
from kfgen.ir.trace import Trace, Value

ROUND_OFF = Fraction(1, 10**6)  # of a squared correlation
Number = Any  # a Value, or a Python or numpy number


def is_zero(a: Number) -> bool:
    """Structurally zero."""
    if isinstance(a, Value):
        return a.node.op == "const" and not a.node.data
    return bool(a == 0)


def is_constant(a: Number) -> bool:
    """Known, and the same in every run."""
    return a.constant is not None if isinstance(a, Value) else True


def is_one(a: Number) -> bool:
    return bool(a.constant == 1) if isinstance(a, Value) else bool(a == 1)


def select(condition: Any, a: Number, b: Number) -> Number:
    """a where the condition holds, else b: a value, not a branch."""
    if isinstance(condition, Value):
        return condition.trace.select(condition, a, b)
    return a if condition else b


def reciprocal(a: Number, least: Number = 0) -> tuple[Any, Number]:
    """Whether a, which is not negative, is above zero, or `least`, and 1/a or 0.

    Above zero is above the smallest number that has a reciprocal: 1/a is then finite, and so is the quotient of
    anything that a contains. least is not below it.
    """
    some = a > (least if not is_zero(least) else a.trace.smallest if isinstance(a, Value) else 0)
    if isinstance(a, Value):
        return some, select(some, 1 / a, 0)
    return some, 1 / a if some else 0


def sqrt(a: Number) -> Number:
    if isinstance(a, Value):
        return a.trace.function("sqrt", a)
    return math.sqrt(a)


def constant_root(value: Fraction) -> Fraction:
    """The square root of a constant, to 60 digits."""
    root = Trace().function("sqrt", value).constant
    assert root is not None
    return root


def is_positive(a: Number) -> bool:
    """Known to be above zero whatever the run brings."""
    return _sign(a.trace, a.node) == 2 if isinstance(a, Value) else bool(a > 0)


def is_nonnegative(a: Number) -> bool:
    """Known not to be below zero."""
    return _sign(a.trace, a.node) >= 1 if isinstance(a, Value) else bool(a >= 0)


def assume_positive(a: Number) -> Number:
    """Record that a guard or an invariant makes a positive."""
    if isinstance(a, Value) and a.constant is None:
        _facts(a.trace)[a.node] = 2
    return a


def assume_nonnegative(a: Number) -> Number:
    if isinstance(a, Value) and a.constant is None:
        facts = _facts(a.trace)
        facts[a.node] = max(1, facts.get(a.node, 0))
    return a


def positive_within(a: Number, declared: Mapping[str, int]) -> bool:
    """Whether a is above zero where inputs and parameters are within what is declared of them. declared: by path, the
    sign of those whose range excludes 0."""
    if not isinstance(a, Value):
        return bool(a > 0)
    trace = a.trace
    kept, trace.signs = trace.signs, {node: 2 for node, sign in trace.signs.items() if sign == 2}
    trace.declared_signs = declared
    found = is_positive(a)
    trace.signs, trace.declared_signs = kept, {}
    return found


def _facts(trace: Trace) -> dict[Node, int]:
    return trace.signs


def require_nonnegative(a: Number, why: str) -> None:
    """Take a as not negative; where that is not known it is left to a guard (Trace.doubts)."""
    if isinstance(a, Value) and not is_nonnegative(a):
        a.trace.doubts.append((a < 0, why))
        assume_nonnegative(a)


def require_no_column(pivot: Number, entry: Number, row: Number, column: Number) -> None:
    """Where a pivot is zero, what is left above it must be round-off: else the matrix was indefinite.

    row, column: the diagonal entries that belong to the entry.
    """
    if isinstance(pivot, Value) and not is_zero(entry):
        left = entry * entry > row * column * ROUND_OFF
        pivot.trace.doubts.append(((pivot <= 0) & left, "a matrix of variances is indefinite"))


def _sign(trace: Trace, node: Node) -> int:
    """2: positive, 1: not negative, 0: not known."""
    facts = _facts(trace)
    stack = [node]  # no recursion: a step of a thousand substeps is as deep
    while node not in facts:
        open_ = [a for a in stack[-1].args if a.kind == "real" and a not in facts]
        if open_ and stack[-1].constant is None:
            stack += open_
            continue
        facts[stack[-1]] = _derive(trace, stack[-1])
        stack.pop()
    return facts[node]


def _derive(trace: Trace, node: Node) -> int:
    value = node.constant
    if value is not None:
        return 2 if value > 0 else 1 if value == Fraction(0) else 0
    signs = [_sign(trace, a) for a in node.args if a.kind == "real"]
    match node.op:
        case "add":
            return max(signs) if min(signs) >= 1 else 0
        case "field":
            return 2 if trace.declared_signs.get(node.data, 0) > 0 else 0
        case "mul" if node.args[0] is node.args[1]:
            return 2 if trace.declared_signs.get(str(node.args[0].data)) else max(1, signs[0])
        case "mul" if node.args[1].op == "mul" and node.args[0] in node.args[1].args:  # a (b a) = b a^2
            other = [n for n in node.args[1].args if n is not node.args[0]] or [node.args[0]]
            return min(1, _sign(trace, other[0]))
        case "mul" | "div":
            return min(signs)
        case "sqrt":
            return max(1, signs[0])
        case "exp":
            return 2
        case "abs":
            return 1
        case "select" | "min":
            return min(signs)
        case "max":
            return max(signs) if max(signs) == 2 else 1 if max(signs) else 0
        case _:
            return 0


def is_negligible(pivot: Number, scale: Number) -> bool:
    """Whether an exactly known pivot is zero but for the digits of its matrix.

    The matrices of a spec were found to be positive semidefinite up to 1e-8 of their diagonal (numbers written in
    decimals), or to 60 digits (numbers computed from constants).
    """
    exact = pivot.constant if isinstance(pivot, Value) else pivot
    whole = scale.constant if isinstance(scale, Value) else scale
    if not isinstance(exact, Fraction) or not isinstance(whole, Fraction):
        return False
    return Fraction(-1, 10**7) * whole <= exact < Fraction(1, 10**30) * whole
