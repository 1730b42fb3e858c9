"""Values with their gradients: SymPy gives the partial derivatives of each expression, this the chain rule.

Definitions (`let`), the stages of an integrator and substeps are thereby never multiplied out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from kfgen.filters.algebra.numbers import is_zero
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Number, Trace, Value
from kfgen.model import Model

Key = TypeVar("Key")
Gradient = dict[str, Value]  # variable name -> derivative; what is not there is 0
Hessian = dict[tuple[str, str], Value]  # pair of variables in alphabetical order -> second derivative


@dataclass(frozen=True)
class Dual:
    """A value and its derivatives by the variables of the moment (states, noises); second ones where asked for."""

    value: Value
    gradient: Gradient = field(default_factory=dict)
    hessian: Hessian = field(default_factory=dict)

    def __add__(self, other: Dual) -> Dual:
        return Dual(self.value + other.value, _sum(self.gradient, other.gradient), _sum(self.hessian, other.hessian))

    def scaled(self, factor: Value | Number) -> Dual:
        """The product with a number that depends on no variable."""
        return Dual(self.value * factor, _scaled(self.gradient, factor), _scaled(self.hessian, factor))


def _sum(a: dict[Key, Value], b: dict[Key, Value]) -> dict[Key, Value]:
    out = dict(a)
    for key, value in b.items():
        out[key] = out[key] + value if key in out else value
    return _nonzero(out)


def _scaled(a: dict[Key, Value], factor: Value | Number) -> dict[Key, Value]:
    return _nonzero({key: value * factor for key, value in a.items()})


def _nonzero(values: dict[Key, Value]) -> dict[Key, Value]:
    return {key: value for key, value in values.items() if not is_zero(value)}


class Evaluator:
    """Evaluates expressions of a model at given duals; definitions are evaluated when first needed.

    order: 2 carries second derivatives too.
    """

    def __init__(self, trace: Trace, model: Model, given: Mapping[str, Dual], order: int = 1) -> None:
        self.order = order
        self.trace = trace
        self.model = model
        self.duals: dict[str, Dual] = dict(given)
        self.lowering = Lowering(trace, {})
        for name, dual in given.items():
            self._bind(name, dual)
        self._definitions = dict(model.definitions)

    def _bind(self, name: str, dual: Dual) -> None:
        self.duals[name] = dual
        symbol = self.model.symbols.get(name)
        if symbol is not None:
            self.lowering.memo[symbol] = dual.value

    def _prepare(self, expression: Any) -> None:
        for symbol in sorted(expression.free_symbols, key=lambda s: s.name):
            if symbol.name not in self.duals and symbol.name in self._definitions:
                definition = self._definitions[symbol.name]
                dual = self(definition)
                self.trace.name(dual.value, symbol.name)
                self._bind(symbol.name, dual)

    def bind(self, symbol: Any, value: Value) -> None:
        """Give a symbol outside of the model (z, h of a residual) a value."""
        self.duals[symbol.name] = Dual(value)
        self.lowering.memo[symbol] = value

    def value(self, expression: Any) -> Value:
        """The value alone."""
        self._prepare(expression)
        return self.lowering(expression)

    def __call__(self, expression: Any) -> Dual:
        value = self.value(expression)
        gradient: Gradient = {}
        for symbol, partial in self.model.partials(expression):
            inner = self.duals[symbol.name].gradient
            if not inner:
                continue
            factor = self.lowering(partial)
            for name, g in inner.items():
                term = factor * g
                gradient[name] = gradient[name] + term if name in gradient else term
        hessian = self._hessian(expression) if self.order > 1 else {}
        return Dual(value, _nonzero(gradient), hessian)

    def _hessian(self, expression: Any) -> Hessian:
        """Chain rule: sum of df/ds s'' over the symbols, and of d2f/ds dr s' r' over pairs of them."""
        out: Hessian = {}

        def add(key: tuple[str, str], term: Value) -> None:
            out[key] = out[key] + term if key in out else term

        for symbol, partial in self.model.partials(expression):
            for key, second in self.duals[symbol.name].hessian.items():
                add(key, self.lowering(partial) * second)
            inner = self.duals[symbol.name].gradient
            if not inner:
                continue
            for other, mixed in self.model.partials(partial):
                factor = self.lowering(mixed)
                for a, ga in inner.items():
                    for b, gb in self.duals[other.name].gradient.items():
                        if a <= b:
                            add((a, b), factor * (ga * gb))
        return _nonzero(out)


def seeds(trace: Trace, values: Mapping[str, Value]) -> dict[str, Dual]:
    """Duals of independent variables."""
    return {name: Dual(value, {name: trace.one}) for name, value in values.items()}
