"""Expression trees to closures: a tree is walked once, then evaluated on any mixture of floats and Duals.

A closure takes the environment, a list with one slot per name. Definitions (`let`) are evaluated when first
used and kept in their slot, so that one that occurs only in the branch of a `where` that is not taken can do
no harm. Comparisons look at values only; a comparison with NaN is false.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from kfgen.reference import dual, rotations
from kfgen.reference.dual import Number, value_of
from kfgen.reference.exact import PI, ROTATIONS, E, Exact, fold, to_float
from kfgen.spec.tree import Call, Expression, Name, Tree
from kfgen.spec.tree import Number as Literal

Environment = list[Any]
Closure = Callable[[Environment], Any]

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "gt": lambda a, b: a > b,
    "ge": lambda a, b: a >= b,
}
_BINARY: dict[str, Callable[[Number, Number], Number]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": dual.quotient,
    "pow": dual.power_general,
    "min": dual.minimum,
    "max": dual.maximum,
    "hypot": dual.apply2("hypot"),
    "atan2": dual.apply2("atan2"),
}


class Scope:
    """The names that expressions may use: constants by exact value, variables by slot, definitions by
    closure.

    Args:
        constants: name -> exact value (compile-time constants and a fixed dt).
        variables: names that the environment holds, in the order of its slots.
    """

    def __init__(self, constants: Mapping[str, Exact], variables: tuple[str, ...]) -> None:
        self._constants: dict[str, Exact] = {"pi": PI, "e": E, **constants}
        self.slots = {name: slot for slot, name in enumerate(dict.fromkeys(variables))}
        self._definitions: dict[str, Closure] = {}

    def define(self, name: str, expression: Expression) -> None:
        """Adds a definition, which may use everything defined before it."""
        exact, closure = self._build(expression.tree)
        if exact is not None:
            self._constants[name] = exact
            return
        slot = self.slots[name] = len(self.slots)

        def kept(environment: Environment) -> Any:
            value = environment[slot]
            if value is None:
                value = environment[slot] = closure(environment)
            return value

        self._definitions[name] = kept

    def empty(self) -> Environment:
        """An environment in which nothing has a value yet."""
        return [None] * len(self.slots)

    def compile(self, expression: Expression | Tree) -> Closure:
        """The closure of an expression: environment -> Number (or bool, for a condition).

        Raises KeyError for a name the scope does not know.
        """
        return self._build(expression.tree if isinstance(expression, Expression) else expression)[1]

    def constant(self, expression: Expression) -> Exact | None:
        """The exact value of an expression that uses constants only, else None."""
        return self._build(expression.tree)[0]

    def _build(self, tree: Tree) -> tuple[Exact | None, Closure]:
        """The exact value, None where it is not constant, and the closure."""
        if isinstance(tree, Literal):
            return _constant(tree.value)
        if isinstance(tree, Name):
            if tree.name in self._constants:
                return _constant(self._constants[tree.name])
            if tree.name in self._definitions:
                return None, self._definitions[tree.name]
            slot = self.slots[tree.name]
            return None, lambda environment: environment[slot]
        parts = [self._build(argument) for argument in tree.args]
        exacts = [exact for exact, _ in parts]
        if all(exact is not None for exact in exacts):
            exact = fold(tree.op, exacts)
            if exact is not None:
                return _constant(exact)
        if tree.op == "pow" and exacts[1] is not None:
            return None, _constant_power(parts[0][1], to_float(exacts[1]))
        return None, _operation(tree, [closure for _, closure in parts])


def renamed(tree: Tree, hidden: Mapping[str, str]) -> Tree:
    """The tree with other names, by which a formula's own variables hide what has their names outside."""
    if isinstance(tree, Name):
        return Name(hidden.get(tree.name, tree.name))
    if isinstance(tree, Call):
        return replace(tree, args=tuple(renamed(argument, hidden) for argument in tree.args))
    return tree


def _constant(exact: Exact) -> tuple[Exact, Closure]:
    value = exact if isinstance(exact, bool) else to_float(exact)
    return exact, lambda environment: value


def _constant_power(base: Closure, exponent: float) -> Closure:
    return lambda environment: dual.power_constant(base(environment), exponent)


def _operation(call: Call, arguments: list[Closure]) -> Closure:
    """The closure of an operator or function on the closures of its arguments."""
    op = call.op
    if op == "table":
        return _table(arguments)
    if op in ROTATIONS:
        return _rotation(call, arguments)
    if op == "where":
        condition, first, second = arguments
        return lambda environment: first(environment) if condition(environment) else second(environment)
    if len(arguments) == 1:
        (a,) = arguments
        if op == "neg":
            return lambda environment: -a(environment)
        if op == "not":
            return lambda environment: not a(environment)
        unary = dual.apply1(op)
        return lambda environment: unary(a(environment))
    a, b = arguments
    if op == "and":
        return lambda environment: a(environment) and b(environment)
    if op == "or":
        return lambda environment: a(environment) or b(environment)
    if op in _COMPARISONS:
        compare = _COMPARISONS[op]
        return lambda environment: compare(value_of(a(environment)), value_of(b(environment)))
    binary = _BINARY[op]
    return lambda environment: binary(a(environment), b(environment))


def _rotation(call: Call, arguments: list[Closure]) -> Closure:
    """A part of a rotation's matrix, vector or quaternion: the first arguments are the numbers of the part."""
    counts = ROTATIONS[call.op]
    place = [int(argument.value) for argument in call.args[:counts] if isinstance(argument, Literal)]
    numbers = arguments[counts:]
    if call.op == "rotation":
        i, j = place
        return lambda environment: rotations.entry(i, j, [number(environment) for number in numbers])
    function = rotations.logarithm if call.op == "rotation_vector" else rotations.exponential
    (k,) = place
    return lambda environment: function([number(environment) for number in numbers])[k]


def _table(arguments: list[Closure]) -> Closure:
    x, points = arguments[0], arguments[1:]
    half = len(points) // 2

    def look_up(environment: Environment) -> Number:
        numbers = [point(environment) for point in points]
        return dual.table(x(environment), [value_of(k) for k in numbers[:half]], numbers[half:])

    return look_up
