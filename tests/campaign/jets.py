"""Expressions of the spec language on numbers that carry first and second derivatives, for the second oracle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


class Jet:
    """A value, its gradient (k) and its Hessian (k, k) in k variables."""

    __slots__ = ("H", "g", "v")

    def __init__(self, v: float, g: Array, H: Array) -> None:
        self.v, self.g, self.H = np.float64(v), g, H

    def through(self, v: float, first: float, second: float) -> Jet:
        """f of it, from f, f' and f'' at its value."""
        H = first * self.H + second * np.outer(self.g, self.g) if np.any(self.g) else first * self.H
        return Jet(v, first * self.g, H)

    def lift(self, other: Any) -> Jet:
        return other if isinstance(other, Jet) else Jet(float(other), 0 * self.g, 0 * self.H)

    def __add__(self, other: Any) -> Jet:
        o = self.lift(other)
        return Jet(self.v + o.v, self.g + o.g, self.H + o.H)

    def __neg__(self) -> Jet:
        return Jet(-self.v, -self.g, -self.H)

    def __sub__(self, other: Any) -> Jet:
        return self + -self.lift(other)

    def __rsub__(self, other: Any) -> Jet:
        return self.lift(other) - self

    def __mul__(self, other: Any) -> Jet:
        o = self.lift(other)
        cross = np.outer(self.g, o.g)
        return Jet(self.v * o.v, self.v * o.g + o.v * self.g, self.v * o.H + o.v * self.H + cross + cross.T)

    def __truediv__(self, other: Any) -> Jet:
        o = self.lift(other)
        return self * o.through(1 / o.v, -1 / o.v**2, 2 / o.v**3)

    def __rtruediv__(self, other: Any) -> Jet:
        return self.lift(other) / self

    def __pow__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return exp(other * log(self))
        n = float(other)
        return self.through(
            self.v**n, n * self.v ** (n - 1) if n else 0.0, n * (n - 1) * self.v ** (n - 2) if n * (n - 1) else 0.0
        )

    def __rpow__(self, other: Any) -> Jet:
        return self.lift(other) ** self

    def __lt__(self, other: Any) -> bool:
        return bool(self.v < self.lift(other).v)

    def __le__(self, other: Any) -> bool:
        return bool(self.v <= self.lift(other).v)

    def __gt__(self, other: Any) -> bool:
        return bool(self.v > self.lift(other).v)

    def __ge__(self, other: Any) -> bool:
        return bool(self.v >= self.lift(other).v)

    __radd__, __rmul__ = __add__, __mul__


def variables(values: Sequence[float]) -> list[Jet]:
    """Independent variables at the given values."""
    k = len(values)
    return [Jet(float(v), np.eye(k)[i], np.zeros((k, k))) for i, v in enumerate(values)]


def constant(value: float, k: int) -> Jet:
    return Jet(float(value), np.zeros(k), np.zeros((k, k)))


def _unary(f: Callable[[Any], Any], first: Callable[[Any], Any], second: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def applied(a: Any) -> Any:
        return a.through(f(a.v), first(a.v), second(a.v)) if isinstance(a, Jet) else f(np.float64(a))

    return applied


def _zero(a: Any) -> float:
    return 0.0


exp = _unary(np.exp, np.exp, np.exp)
log = _unary(np.log, lambda a: 1 / a, lambda a: -1 / a**2)
_sqrt = _unary(np.sqrt, lambda a: 0.5 / np.sqrt(a) if a > 0 else 0.0, lambda a: -0.25 / a**1.5 if a > 0 else 0.0)


def _hypot(a: Any, b: Any) -> Any:
    return _sqrt(a * a + b * b)


def _atan2(y: Any, x: Any) -> Any:
    """Its derivatives are those of the angle of (x, y)."""
    if not isinstance(y, Jet) and not isinstance(x, Jet):
        return np.arctan2(y, x)
    y, x = (y if isinstance(y, Jet) else x.lift(y)), (x if isinstance(x, Jet) else y.lift(x))
    square = x.v**2 + y.v**2
    if square == 0:
        return constant(np.arctan2(y.v, x.v), len(y.g))
    p, q = x.v / square, -y.v / square  # d/dy, d/dx
    pp, qq, pq = -2 * x.v * y.v / square**2, 2 * x.v * y.v / square**2, (y.v**2 - x.v**2) / square**2
    cross = np.outer(y.g, x.g)
    H = p * y.H + q * x.H + pp * np.outer(y.g, y.g) + qq * np.outer(x.g, x.g) + pq * (cross + cross.T)
    return Jet(np.arctan2(y.v, x.v), p * y.g + q * x.g, H)


def _table(x: Any, xs: Sequence[float], ys: Sequence[float]) -> Any:
    """Linear between the points, clamped at the ends; at both ends the inner slope."""
    v = x.v if isinstance(x, Jet) else x
    value = np.interp(v, xs, ys)
    if not isinstance(x, Jet):
        return value
    i = min(max(int(np.searchsorted(xs, v, side="right")) - 1, 0), len(xs) - 2)
    slope = (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i]) if xs[0] <= v <= xs[-1] else 0.0
    return x.through(value, slope, 0.0)


def _value(a: Any) -> float:
    return float(a.v if isinstance(a, Jet) else a)


FUNCTIONS: dict[str, Any] = {
    "sin": _unary(np.sin, np.cos, lambda a: -np.sin(a)),
    "cos": _unary(np.cos, lambda a: -np.sin(a), lambda a: -np.cos(a)),
    "tan": _unary(np.tan, lambda a: 1 + np.tan(a) ** 2, lambda a: 2 * np.tan(a) * (1 + np.tan(a) ** 2)),
    "tanh": _unary(np.tanh, lambda a: 1 - np.tanh(a) ** 2, lambda a: -2 * np.tanh(a) * (1 - np.tanh(a) ** 2)),
    "sinh": _unary(np.sinh, np.cosh, np.sinh),
    "cosh": _unary(np.cosh, np.sinh, np.cosh),
    "asin": _unary(np.arcsin, lambda a: (1 - a * a) ** -0.5, lambda a: a * (1 - a * a) ** -1.5),
    "acos": _unary(np.arccos, lambda a: -((1 - a * a) ** -0.5), lambda a: -a * (1 - a * a) ** -1.5),
    "atan": _unary(np.arctan, lambda a: 1 / (1 + a * a), lambda a: -2 * a / (1 + a * a) ** 2),
    "exp": exp, "log": log, "sqrt": _sqrt, "hypot": _hypot, "atan2": _atan2, "table": _table,
    "abs": _unary(np.abs, np.sign, _zero), "sign": _unary(np.sign, _zero, _zero),
    "floor": _unary(np.floor, _zero, _zero),
    "min": lambda a, b: a if _value(a) <= _value(b) else b,
    "max": lambda a, b: a if _value(a) >= _value(b) else b,
    "where": lambda condition, a, b: a if condition else b,
    "pi": np.pi, "e": np.e,
}  # fmt: skip


class Names(dict[str, Any]):
    """What names stand for; definitions are worked out when they are first asked for."""

    def __init__(self, values: Mapping[str, Any], definitions: Mapping[str, Any]) -> None:
        super().__init__(values)
        self.definitions = definitions

    def __missing__(self, name: str) -> Any:
        if name in self.definitions:
            self[name] = evaluate(self.definitions[name], self)
            return self[name]
        return FUNCTIONS[name]


_compiled: dict[str, Any] = {}


def evaluate(expression: Any, names: Names) -> Any:
    """A number, or an expression's text, whose grammar is Python's. The specs are this campaign's own."""
    if isinstance(expression, int | float):
        return float(expression)
    if expression not in _compiled:
        _compiled[expression] = compile(expression.strip(), "spec", "eval")
    return eval(_compiled[expression], {"__builtins__": {}}, names)
