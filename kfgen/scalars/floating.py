"""float and double: C spelling, and the same arithmetic in numpy."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from kfgen import scalar_names

_LIBM = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "floor",
         "atan2", "pow")  # fmt: skip


class Floating:
    """An IEEE 754 type."""

    helpers = "helpers/float.j2"
    helper_ops = frozenset({"finite", "wrap", "segment", "min", "max", "sign", "sign_bit"})
    silent_ops: frozenset[str] = frozenset()
    uniform = True

    def __init__(self, name: str, dtype: type[np.floating[Any]], suffix: str) -> None:
        self.name = self.c_type = name
        self.dtype = dtype
        self.suffix = suffix
        info = np.finfo(dtype)
        self.size = info.bits // 8
        self.epsilon = Fraction(float(info.eps))
        self.smallest = Fraction(2) ** int(info.minexp)
        self.probability = Fraction(0)
        self._mantissa = info.nmant + 1
        self._smallest = int(info.minexp) - info.nmant

    def nearest(self, value: Fraction) -> Fraction:
        """Round half to even at this type's precision, once, from the exact value."""
        if value == 0:
            return value
        magnitude = abs(value)
        exponent = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
        while Fraction(2) ** exponent > magnitude:
            exponent -= 1
        while Fraction(2) ** (exponent + 1) <= magnitude:
            exponent += 1
        unit = Fraction(2) ** max(exponent - self._mantissa + 1, self._smallest)
        rounded = round(magnitude / unit) * unit
        return rounded if value > 0 else -rounded

    def literal(self, value: Fraction) -> str:
        with np.errstate(over="ignore"):
            number = self.dtype(float(self.nearest(value)))
        if not np.isfinite(number):
            raise OverflowError(f"{float(value):g} does not fit a {self.name}")
        text = np.format_float_scientific(number, unique=True, trim="-")
        mantissa, exponent = text.split("e")
        if -5 <= int(exponent) < 8:
            text = np.format_float_positional(number, unique=True, trim="0")
        else:
            text = f"{mantissa if '.' in mantissa else mantissa + '.0'}e{int(exponent)}"
        return text + self.suffix

    def function(self, op: str) -> str:
        if op == "abs":
            return "fabs" + self.suffix
        if op in _LIBM or op == "ceil":
            return op + self.suffix
        raise KeyError(op)

    def convert(self, value: Any) -> Any:
        if isinstance(value, Fraction):
            value = float(self.nearest(value))
        return self.dtype(value)

    def evaluate(self, op: str, data: Any, args: list[Any]) -> Any:
        if op == "sum":
            return self._sum(data, args)
        with np.errstate(all="ignore"):
            return _OPERATIONS[op](self, data, *args)

    def _sum(self, pattern: tuple[tuple[int, int], ...], factors: list[Any]) -> Any:
        """Left to right, each product and each sum rounded, as C does without contraction."""
        total: Any = None
        position = 0
        with np.errstate(all="ignore"):
            for sign, count in pattern:
                term = factors[position]
                if total is None and sign < 0:
                    term = -term
                if count == 2:
                    term = term * factors[position + 1]
                position += count
                total = term if total is None else total + term if sign > 0 else total - term
        return total


def _libm(op: str) -> Callable[..., Any]:
    name = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "power"}.get(op, op)

    def call(scalar: Floating, data: Any, *args: Any) -> Any:
        return scalar.dtype(getattr(np, name)(*args))

    return call


def _wrap(s: Floating, period: Fraction, a: Any) -> Any:
    half = s.convert(period / 2)
    whole = half + half
    if a > half or a <= -half:
        a = a - whole * np.ceil((a - half) / whole)
        if a > half or a <= -half:
            a = half
    return a


def _segment(s: Floating, table: Any, a: Any) -> int:
    return sum(1 for v in table.x if s.convert(v) <= a)


def _table(s: Floating, table: Any, i: int, a: Any) -> Any:
    return s.convert(table.values()[i]) + s.convert(table.slopes()[i]) * (a - s.convert(table.starts()[i]))


_OPERATIONS: dict[str, Callable[..., Any]] = {
    **{op: _libm(op) for op in _LIBM},
    "add": lambda s, d, a, b: a + b,
    "sub": lambda s, d, a, b: a - b,
    "mul": lambda s, d, a, b: a * b,
    "div": lambda s, d, a, b: a / b,
    "neg": lambda s, d, a: -a,
    "abs": lambda s, d, a: abs(a),
    "min": lambda s, d, a, b: b if b < a else a,
    "max": lambda s, d, a, b: b if b > a else a,
    "sign": lambda s, d, a: s.dtype((a > 0) * 1 - (a < 0) * 1),
    "wrap": _wrap,
    "table": _table,
    "segment": _segment,
    "slope": lambda s, table, i: s.convert(table.slopes()[i]),
    "finite": lambda s, d, a: bool(a - a >= 0),
    "signs": lambda s, d, *args: int(np.signbit(args[-1])) | (args[0] if len(args) > 1 else 0),
    "some": lambda s, d, a: a != 0,
    "lt": lambda s, d, a, b: bool(a < b),
    "le": lambda s, d, a, b: bool(a <= b),
    "and": lambda s, d, a, b: a and b,
    "or": lambda s, d, a, b: a or b,
    "not": lambda s, d, a: not a,
    "select": lambda s, d, c, a, b: a if c else b,
}

FLOAT = Floating(scalar_names.FLOAT, np.float32, "f")
DOUBLE = Floating(scalar_names.DOUBLE, np.float64, "")
