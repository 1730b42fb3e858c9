"""Whether a formula is affine in some of its names, and what its coefficients rest on.

Decided by structure first, which is certain where it says yes; where it says no, the formula is
evaluated at random points (`(x + 1)**2 - x**2` is linear, too).
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import mpmath

from kfgen.spec.constants import NotConstant, keep, value
from kfgen.spec.contexts import Context
from kfgen.spec.operations import DIGITS, NoValue, Value, real
from kfgen.spec.tree import Call, Name, Tree


@dataclass(frozen=True)
class Form:
    """Whether a formula depends on the variables, is affine in them, and which names multiply them."""

    depends: bool
    affine: bool
    names: frozenset[str]
    coefficients: frozenset[str] = frozenset()


class Affine:
    def __init__(self, context: Context, variables: frozenset[str]) -> None:
        self.context, self.variables = context, variables
        self.definitions: dict[str, Form] = {}
        for definition in context.let:
            self.definitions[definition.name] = self.form(definition.value.tree)

    def form(self, tree: Tree) -> Form:
        if isinstance(tree, Name):
            if tree.name in self.definitions:
                return self.definitions[tree.name]
            return Form(tree.name in self.variables, True, frozenset({tree.name}))
        if not isinstance(tree, Call):
            return Form(False, True, frozenset())
        parts = [self.form(argument) for argument in tree.args]
        found = frozenset().union(*(part.names for part in parts))
        if not any(part.depends for part in parts):
            return Form(False, True, found)
        coefficients = frozenset().union(*(part.coefficients for part in parts))
        affine = all(part.affine for part in parts)
        if tree.op == "mul":
            affine = affine and not all(part.depends for part in parts)
            coefficients |= frozenset().union(*(part.names for part in parts if not part.depends))
        elif tree.op in ("div", "where"):
            divisor = parts[1] if tree.op == "div" else parts[0]
            affine = affine and not divisor.depends
            coefficients |= divisor.names
        elif tree.op not in ("add", "sub", "neg"):
            affine = False
        return Form(True, affine, found, coefficients if affine else found)

    def is_affine(self, tree: Tree, known: Mapping[str, Value]) -> bool:
        """By structure, else by values; `known` are the values of constants and parameters."""
        return self.form(tree).affine or self._by_values(tree, known)

    def _by_values(self, tree: Tree, known: Mapping[str, Value]) -> bool:
        draw = random.Random(1)  # the same points on every run
        others = {
            name: Fraction(draw.randint(10, 990), 1000)
            for name in sorted(self.context.kinds.keys() | {"dt", "t"})
            if name not in self.variables and name not in known and name not in self.definitions
        }
        names = sorted(self.variables)

        def at(point: Mapping[str, Fraction]) -> Value:
            environment: dict[str, Value] = {**known, **others, **point}
            for definition in self.context.let:
                keep(environment, definition.name, definition.value.tree)
            return real(value(tree, environment))

        try:
            with mpmath.workdps(DIGITS):
                return all(self._additive(at, names, draw, scale) for scale in (1, 40, 1000, 3))
        except (NotConstant, NoValue):
            return False

    @staticmethod
    def _additive(
        at: Callable[[Mapping[str, Fraction]], Value], names: list[str], draw: random.Random, scale: int
    ) -> bool:
        a = {name: Fraction(draw.randint(-999, 999) * scale, 997) for name in names}
        b = {name: Fraction(draw.randint(-999, 999) * scale, 991) for name in names}
        both = {name: a[name] + b[name] for name in names}
        values = at(both), at({name: Fraction(0) for name in names}), at(a), at(b)
        size = sum(abs(v) for v in values)
        return bool(abs(values[0] + values[1] - values[2] - values[3]) <= size * 1e-30)
