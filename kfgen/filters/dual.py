"""Values with their gradients: SymPy gives the partial derivatives of each expression, this the chain rule.

Definitions (`let`), the stages of an integrator and substeps are thereby never multiplied out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kfgen.filters.numbers import is_zero
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Number, Trace, Value
from kfgen.model import Model

Gradient = dict[str, Value]  # variable name -> derivative; what is not there is 0


@dataclass(frozen=True)
class Dual:
    """A value and its derivatives by the variables of the moment (states, noises)."""

    value: Value
    gradient: Gradient = field(default_factory=dict)

    def __add__(self, other: Dual) -> Dual:
        out = dict(self.gradient)
        for name, g in other.gradient.items():
            out[name] = out[name] + g if name in out else g
        return Dual(self.value + other.value, _nonzero(out))

    def scaled(self, factor: Value | Number) -> Dual:
        """The product with a number that depends on no variable."""
        gradient = {name: g * factor for name, g in self.gradient.items()}
        return Dual(self.value * factor, _nonzero(gradient))


def _nonzero(gradient: Gradient) -> Gradient:
    return {name: g for name, g in gradient.items() if not is_zero(g)}


class Evaluator:
    """Evaluates expressions of a model at given duals; definitions are evaluated when first needed."""

    def __init__(self, trace: Trace, model: Model, given: Mapping[str, Dual]) -> None:
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
        return Dual(value, _nonzero(gradient))


def seeds(trace: Trace, values: Mapping[str, Value]) -> dict[str, Dual]:
    """Duals of independent variables."""
    return {name: Dual(value, {name: trace.one}) for name, value in values.items()}
