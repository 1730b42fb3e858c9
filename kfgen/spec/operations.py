"""Numbers and the operations on them: an exact fraction wherever it is rational, else 60 digits.

Bounded: magnitudes, digits and integer exponents have limits, so that no expression can hang.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from math import isqrt
from typing import Any

import mpmath

from kfgen.errors import KfgenError
from kfgen.spec.expressions import MAX_EXPONENT

DIGITS = 60
Value = Any  # Fraction | mpmath.mpf, which has no types of its own

_MAX_BITS = 8_000  # of an exact fraction; beyond it, 60 digits
_HUGE, _TINY = Fraction(10) ** 400, Fraction(1, 10**400)


class NoValue(KfgenError):  # noqa: N818 - a finding about a formula, which callers expect
    """The expression has no finite real value: division by zero, root of a negative number, too large.

    The text is a sentence about the expression, `hint` the cure.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


def apply(op: str, arguments: list[Value]) -> Value:
    """An operator or function (not `where`, no condition) applied to values."""
    with mpmath.workdps(DIGITS):
        return applied(op, arguments)


def applied(op: str, arguments: list[Value]) -> Value:
    """As `apply`, within `mpmath.workdps(DIGITS)`."""
    return bounded(_APPLY[op](*arguments))


def is_exact(number: Value) -> bool:
    return isinstance(number, Fraction)


def real(number: Value) -> Any:
    """A value as mpmath number (within `mpmath.workdps`)."""
    if isinstance(number, Fraction):
        return mpmath.mpf(number.numerator) / number.denominator
    return number


def less(a: Value, b: Value, or_equal: bool = False) -> bool:
    """a < b (or <=), exactly where both are exact."""
    if not (is_exact(a) and is_exact(b)):
        with mpmath.workdps(DIGITS):
            a, b = real(a), real(b)
            return bool(a <= b if or_equal else a < b)
    return bool(a <= b if or_equal else a < b)


def bounded(number: Value) -> Value:
    """The number, in 60 digits where its exact form has become too long; NoValue where it is too large."""
    if isinstance(number, Fraction):
        if number.numerator.bit_length() + number.denominator.bit_length() <= _MAX_BITS:
            exact = number
            if number and not _TINY <= abs(number) <= _HUGE:
                return _out_of_range(abs(number) > 1)
            return exact
        number = real(number)
    if not mpmath.isfinite(number) or isinstance(number, mpmath.mpc):
        raise NoValue("the expression has no finite real value", "correct it")
    if number != 0 and abs(mpmath.mag(number)) > 1328:  # 10**400
        return _out_of_range(mpmath.mag(number) > 0)
    return number


def _out_of_range(large: bool) -> Value:
    if large:
        raise NoValue("the value of the expression is too large", "choose other units")
    return Fraction(0)


def _divide(a: Value, b: Value) -> Value:
    if b == 0:
        raise NoValue("the expression divides by zero", "write a divisor that is not 0")
    return a / b if is_exact(a) and is_exact(b) else real(a) / real(b)


def _arithmetic(exact: Callable[[Any, Any], Any]) -> Callable[[Value, Value], Value]:
    def apply(a: Value, b: Value) -> Value:
        return exact(a, b) if is_exact(a) and is_exact(b) else exact(real(a), real(b))

    return apply


def _power(base: Value, exponent: Value) -> Value:
    whole = exponent == mpmath.floor(real(exponent))
    if whole and abs(exponent) > MAX_EXPONENT:
        raise NoValue(f"an integer exponent may be at most {MAX_EXPONENT} in size", "use a smaller one")
    if base == 0 and exponent < 0:
        raise NoValue("the expression divides by zero", "write a divisor that is not 0")
    if whole:
        power = int(exponent)
        small = is_exact(base) and (base.numerator.bit_length() + base.denominator.bit_length()) * abs(power) < 16_000
        return base**power if small else real(base) ** power
    if base < 0:
        raise NoValue("a negative number has no real power with this exponent", "use a whole exponent")
    if base == 0:
        return Fraction(0)
    if is_exact(exponent) and exponent.denominator == 2 and abs(exponent) < MAX_EXPONENT:
        root = _sqrt(base)
        if is_exact(root):
            return _power(root, Fraction(exponent.numerator))
    logarithm = mpmath.log(real(base)) * real(exponent)
    return _exp(logarithm)


def _exp(a: Value) -> Value:
    if a == 0:
        return Fraction(1)
    if a > 1000:
        raise NoValue("the value of the expression is too large", "choose other units")
    return Fraction(0) if a < -1000 else mpmath.exp(real(a))


def _sqrt(a: Value) -> Value:
    if a < 0:
        raise NoValue("the expression takes the square root of a negative number", "correct its sign")
    if is_exact(a):
        n, d = isqrt(a.numerator), isqrt(a.denominator)
        if n * n == a.numerator and d * d == a.denominator:
            return Fraction(n, d)
    return mpmath.sqrt(real(a))


def _log(a: Value) -> Value:
    if a <= 0:
        raise NoValue("the expression takes the logarithm of a number that is not positive", "correct it")
    return Fraction(0) if a == 1 else mpmath.log(real(a))


def _hypot(a: Value, b: Value) -> Value:
    add, multiply = _APPLY["add"], _APPLY["mul"]
    return _sqrt(add(multiply(a, a), multiply(b, b)))


def _arc(function: Callable[[Any], Any], name: str) -> Callable[[Value], Value]:
    def apply(a: Value) -> Value:
        if abs(a) > 1:
            raise NoValue(f"`{name}` wants an argument between -1 and 1", "correct the argument")
        return function(real(a))

    return apply


def _odd(function: Callable[[Any], Any], at_zero: int, limit: int | None = None) -> Callable[[Value], Value]:
    """A function of mpmath whose value at 0 is a whole number and stays exact."""

    def apply(a: Value) -> Value:
        if a == 0:
            return Fraction(at_zero)
        if limit is not None and abs(a) > limit:
            raise NoValue("the value of the expression is too large", "choose other units")
        return function(real(a))

    return apply


def _tanh(a: Value) -> Value:
    if a == 0:
        return Fraction(0)
    return mpmath.tanh(real(a)) if abs(a) < 1000 else Fraction(1 if a > 0 else -1)


def _atan2(y: Value, x: Value) -> Value:
    return Fraction(0) if y == 0 and x >= 0 else mpmath.atan2(real(y), real(x))


def _table(x: Value, *points: Value) -> Value:
    """Linear between the points, clamped at the ends."""
    half = len(points) // 2
    xs, ys = points[:half], points[half:]
    if any(not less(a, b) for a, b in pairwise(xs)):
        raise NoValue("the first list of `table` does not increase", "sort the points")
    if less(x, xs[0], True):
        return ys[0]
    for x0, x1, y0, y1 in zip(xs, xs[1:], ys, ys[1:], strict=False):
        if less(x, x1, True):
            sub, mul = _APPLY["sub"], _APPLY["mul"]
            return _APPLY["add"](y0, mul(sub(y1, y0), _divide(sub(x, x0), sub(x1, x0))))
    return ys[-1]


def _entry(i: Value, j: Value, w: Value, x: Value, y: Value, z: Value) -> Value:
    """R(q)_ij, with |q| = 1 used as it always is: 1 - 2 (y^2 + z^2), 2 (x y - w z), ..."""
    add, sub, mul = (_APPLY[op] for op in ("add", "sub", "mul"))
    row, column, v = int(i), int(j), (x, y, z)
    if row == column:
        others = [mul(p, p) for k, p in enumerate(v) if k != row]
        return sub(Fraction(1), mul(Fraction(2), add(*others)))
    crossed = mul(w, v[3 - row - column])
    combine = add if (column - row) % 3 == 2 else sub
    return mul(Fraction(2), combine(mul(v[row], v[column]), crossed))


def _rotation_vector(k: Value, w: Value, x: Value, y: Value, z: Value) -> Value:
    """2 atan2(|v|, |w|) v / |v|, of q and -q the same: at most pi."""
    v = (x, y, z)
    length = _sqrt(_sum_of_squares(v))
    sign = -1 if w < 0 else 1
    if length == 0:
        return Fraction(0)
    return real(v[int(k)]) * sign * 2 * mpmath.atan2(real(length), abs(real(w))) / real(length)


def _from_rotation_vector(k: Value, x: Value, y: Value, z: Value) -> Value:
    """(cos |d|/2, d sin(|d|/2) / |d|)."""
    v = (x, y, z)
    length = _sqrt(_sum_of_squares(v))
    if length == 0:
        return Fraction(int(k == 0))
    half = real(length) / 2
    return mpmath.cos(half) if k == 0 else real(v[int(k) - 1]) * mpmath.sin(half) / real(length)


def _sum_of_squares(v: tuple[Value, ...]) -> Value:
    add, mul = _APPLY["add"], _APPLY["mul"]
    total: Value = Fraction(0)
    for part in v:
        total = add(total, mul(part, part))
    return total


_APPLY: dict[str, Callable[..., Value]] = {
    "add": _arithmetic(lambda a, b: a + b),
    "sub": _arithmetic(lambda a, b: a - b),
    "mul": _arithmetic(lambda a, b: a * b),
    "div": _divide,
    "pow": _power,
    "neg": lambda a: -a,
    "sin": _odd(mpmath.sin, 0),
    "cos": _odd(mpmath.cos, 1),
    "tan": _odd(mpmath.tan, 0),
    "asin": _arc(mpmath.asin, "asin"),
    "acos": _arc(mpmath.acos, "acos"),
    "atan": _odd(mpmath.atan, 0),
    "atan2": _atan2,
    "sinh": _odd(mpmath.sinh, 0, 1000),
    "cosh": _odd(mpmath.cosh, 1, 1000),
    "tanh": _tanh,
    "exp": _exp,
    "log": _log,
    "sqrt": _sqrt,
    "abs": abs,
    "sign": lambda a: Fraction((a > 0) - (a < 0)),
    "min": lambda a, b: b if less(b, a) else a,
    "max": lambda a, b: b if less(a, b) else a,
    "hypot": _hypot,
    "floor": lambda a: Fraction(int(mpmath.floor(a))) if not is_exact(a) else Fraction(a.__floor__()),
    "table": _table,
    "rotation": _entry,
    "rotation_vector": _rotation_vector,
    "from_rotation_vector": _from_rotation_vector,
}
