"""SymPy expressions as values of a traced program.

Sharing is the program's: lowering the same subexpression twice gives the same node.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import sympy

from kfgen.ir import constants, turning
from kfgen.ir.nodes import Table
from kfgen.ir.trace import Trace, Value

_SHORT_NAMES = frozenset({"sin", "cos", "tan", "exp", "log", "sqrt", "asin", "acos", "atan"})
_DIRECT = {
    "Absolute": "abs", "Sign": "sign", "Floor": "floor", "Minimum": "min", "Maximum": "max", "Atan2": "atan2",
    "Root": "sqrt",
}  # fmt: skip


class Lowering:
    """Lowers expressions under one assignment of values to symbols."""

    def __init__(self, trace: Trace, values: Mapping[Any, Value]) -> None:
        self.trace = trace
        self.memo: dict[Any, Value] = dict(values)

    def __call__(self, expression: Any) -> Value:
        found = self.memo.get(expression)
        if found is None:
            found = self.memo[expression] = self._lower(expression)
        return found

    def _lower(self, e: Any) -> Value:
        t = self.trace
        if e.is_Rational:
            return t.value(Fraction(int(e.p), int(e.q)))
        if e is sympy.pi:
            return t.value(constants.pi())
        if e is sympy.E:
            return t.function("exp", 1)
        if e.is_Add:
            return self._sum(e)
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        if e.is_Symbol:
            raise KeyError(f"no value for {e}")
        return self._call(e)

    def _sum(self, e: Any) -> Value:
        terms = sorted(((bool(arg.as_coeff_Mul()[0] < 0), i, arg) for i, arg in enumerate(e.args)), key=lambda x: x[:2])
        total: Value | None = None
        for negative, _, term in terms:
            if total is None:
                total = self(term)
            elif negative:
                total = total - self(-term)
            else:
                total = total + self(term)
        assert total is not None
        return total

    def _product(self, e: Any) -> Value:
        coefficient, rest = e.as_coeff_Mul()
        above: list[Value] = []
        below: list[Value] = []
        for factor in sympy.Mul.make_args(rest):
            base, exponent = factor.as_base_exp()
            if exponent.is_Rational and exponent < 0 and base is not sympy.E:
                below.append(self(base**-exponent))
            else:
                above.append(self(factor))
        # a division by an integer of the coefficient stays a multiplication by its reciprocal
        numerator = self._times(above)
        value = numerator if not below else numerator / self._times(below)
        return (
            value * Fraction(int(coefficient.p), int(coefficient.q))
            if coefficient.is_Rational
            else (value * self(coefficient))
        )

    def _times(self, factors: list[Value]) -> Value:
        total = self.trace.one
        for factor in factors:
            total = total * factor
        return total

    def _power(self, base: Any, exponent: Any) -> Value:
        if base is sympy.E:
            return self._named("exp", exponent)
        if exponent.is_Rational:
            if exponent < 0:
                return 1 / self(base**-exponent)
            if exponent.is_Integer:
                return self._integer_power(self(base), int(exponent))
            if exponent.q == 2:
                whole = int(exponent.p // 2)
                root = self._named("sqrt", base)
                return root if whole == 0 else self._integer_power(self(base), whole) * root
        return self.trace.function("pow", self(base), self(exponent))

    def _integer_power(self, base: Value, n: int) -> Value:
        if n == 1:
            return base
        half = self._integer_power(base, n // 2)
        return half * half if n % 2 == 0 else half * half * base

    def _named(self, op: str, argument: Any) -> Value:
        """A function of one argument; of a plain symbol it is kept under its name: `sin_th`."""
        value = self.trace.function(op, self(argument))
        if argument.is_Symbol and op in _SHORT_NAMES:
            self.trace.name(value, f"{op}_{argument.name}".replace(".", "_"))  # an entry of a rotation has a dot
        return value

    def _call(self, e: Any) -> Value:
        t = self.trace
        name = type(e).__name__
        args = e.args
        match name:
            case "Where":
                return t.select(self(args[0]), self(args[1]), self(args[2]))
            case "Less":
                return self(args[0]) < self(args[1])
            case "LessEqual":
                return self(args[0]) <= self(args[1])
            case "Both":
                return self(args[0]) & self(args[1])
            case "Either":
                return self(args[0]) | self(args[1])
            case "Negation":
                return ~self(args[0])
            case "SafeReciprocal":
                a = self(args[0])
                return t.select(a > 0, 1 / a, 0)
            case "Norm":
                squares = [self._integer_power(self(a), 2) for a in args]
                return t.function("sqrt", sum(squares[1:], squares[0]))
            case "Stumpff":
                return turning.stumpff(t, int(args[0]), self(args[1]))
            case "LogScale":
                return turning.log_scale(t, self(args[0]), self(args[1]))
            case "LogSlope":
                return turning.log_slope(t, self(args[0]), self(args[1]))
            case "Table" | "Slope":
                count = (len(args) - 1) // 2
                data = [self(a).constant for a in args[1:]]
                exact = [v for v in data if v is not None]
                assert len(exact) == 2 * count, "a table's data are constants"
                table = Table(tuple(exact[:count]), tuple(exact[count:]))
                return t.table(self(args[0]), table, name == "Slope")
        op = _DIRECT.get(name, name)
        if len(args) == 1:
            return self._named(op, args[0])
        return t.function(op, *[self(a) for a in args])
