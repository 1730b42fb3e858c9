"""Values with their gradients: SymPy gives the partial derivatives of each expression, this the chain rule.

Definitions (`let`), the stages of an integrator and substeps are thereby never multiplied out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kfgen.filters.algebra.attitude import Attitude
from kfgen.filters.algebra.gradient import Dual, Gradient, Hessian, nonzero
from kfgen.geometry.rotation import matrix
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model

__all__ = ["Attitude", "Dual", "Evaluator", "attitudes", "held_attitudes", "seeds", "state_seeds", "state_values"]

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
        self.attitudes = attitudes(trace, model, self.duals)

    def _bind(self, name: str, dual: Dual) -> None:
        self.duals[name] = dual
        symbol = self.model.symbols.get(name)
        if symbol is not None:
            self.lowering.memo[symbol] = dual.value

    def _prepare(self, expression: Any) -> None:
        for symbol in sorted(expression.free_symbols, key=lambda s: s.name):
            if symbol.name not in self.duals and symbol.name in self._definitions:
                turned = self.model.turned.get(symbol.name)
                if turned is not None and turned.rotation in self.attitudes and self.order == 1:
                    self._bind(symbol.name, self._turned(turned, self.attitudes[turned.rotation]))
                    continue
                definition = self._definitions[symbol.name]
                dual = self(definition)
                self.trace.name(dual.value, symbol.name.replace(".", "_"))
                self._bind(symbol.name, dual)

    def _turned(self, what: Any, attitude: Attitude) -> Dual:
        """An entry of R(q), or of what it turns."""
        if what.vector is None:
            return attitude.entry(what.i, what.j)
        return attitude.turned([self(e) for e in what.vector], what.i, what.transposed)

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
        return Dual(value, nonzero(gradient), hessian)

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
        return nonzero(out)


def seeds(trace: Trace, values: Mapping[str, Value]) -> dict[str, Dual]:
    """Duals of independent variables."""
    return {name: Dual(value, {name: trace.one}) for name, value in values.items()}


def state_seeds(t: Trace, model: Model, x: Sequence[Value]) -> dict[str, Dual]:
    """Duals of the states (in the spec's order), by their errors."""
    out = {name: Dual(value, {name: t.one}) for name, value in zip(model.states, x, strict=True)}
    for r in model.rotations:
        attitude = Attitude(t, r.name, r.geometry, x[r.first : r.first + 4], [{e: t.one} for e in r.errors])
        out.update(zip(r.parts, attitude.numbers(), strict=True))
    return out


def held_attitudes(t: Trace, model: Model) -> dict[str, Dual]:
    """The quaternions, of which R(q) is a constant of a step, their numbers are not."""
    out: dict[str, Dual] = {}
    for r in model.rotations:
        q = [t.element("kf.x", r.first + k) for k in range(4)]
        attitude = Attitude(t, r.name, r.geometry, q, [{}, {}, {}], held=True)
        attitude.rows = matrix([t.field(f"attitude.{part}") for part in r.parts])
        out.update(zip(r.parts, attitude.numbers(), strict=True))
    return out


def state_values(model: Model, x: Sequence[Value]) -> dict[str, Dual]:
    """The states without derivatives."""
    return {name: Dual(value) for name, value in zip(model.states, x, strict=True)}


def attitudes(t: Trace, model: Model, duals: Mapping[str, Dual]) -> dict[str, Attitude]:
    """The quaternions whose four numbers are given: as rotations, or without derivatives."""
    found = {}
    for r in model.rotations:
        numbers = [duals[part] for part in r.parts if part in duals]
        if len(numbers) == 4:
            if numbers[0].attitude is not None:
                found[r.name] = numbers[0].attitude
            elif not any(d.gradient for d in numbers):
                found[r.name] = Attitude(t, r.name, r.geometry, [d.value for d in numbers], [{}, {}, {}])
    return found
