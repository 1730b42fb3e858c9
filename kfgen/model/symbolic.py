"""Expression trees of the spec as SymPy expressions, exact: decimals are rationals, constants substituted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import reduce
from operator import mul
from typing import Any

import sympy

from kfgen.model import functions as kf
from kfgen.model import turning
from kfgen.model.rotations import Names, entries, gathered
from kfgen.spec.tree import Call, Name, Number, Tree, names
from kfgen.spec.types import Constant

_LONG = 50  # names in a constant, those in the constants that it uses counted with them


def to_sympy(tree: Tree, known: Mapping[str, Any]) -> Any:
    """The SymPy expression of a tree; known maps every name of it to an expression."""
    if isinstance(tree, Number):
        return sympy.Rational(tree.value.numerator, tree.value.denominator)
    if isinstance(tree, Name):
        if tree.name == "pi" and "pi" not in known:
            return sympy.pi
        if tree.name == "e" and "e" not in known:
            return sympy.E
        return known[tree.name]
    assert isinstance(tree, Call)
    registry = known.registry if isinstance(known, Names) else None
    if tree.op == "rotation":
        i, j = (int(a.value) for a in tree.args[:2] if isinstance(a, Number))
        numbers = [to_sympy(argument, known) for argument in tree.args[2:]]
        return entries(numbers)[i][j] if registry is None else registry.entry(numbers, i, j)
    if registry is not None and registry.quartets and tree.op in ("add", "sub"):
        return gathered(registry, sympy.Add(*_terms(tree, 1, known)))
    return _CALLS[tree.op](*[to_sympy(argument, known) for argument in tree.args])


def _terms(tree: Tree, sign: int, known: Mapping[str, Any]) -> Iterator[Any]:
    """The terms of a sum of sums."""
    if isinstance(tree, Call) and tree.op in ("add", "sub"):
        yield from _terms(tree.args[0], sign, known)
        yield from _terms(tree.args[1], sign if tree.op == "add" else -sign, known)
    else:
        yield sign * to_sympy(tree, known)


def constants(entries: Iterable[Constant], value: Callable[[Any], Fraction | None]) -> dict[str, Any]:
    """The constants of a spec as they are written; one with others written into it that is long by now, as its
    `value`: each that uses two of the one before would double the algebra."""
    found: dict[str, Any] = {}
    sizes: dict[str, int] = {}
    for entry in entries:
        parts = list(names(entry.value.tree))
        sizes[entry.name] = len(parts) + sum(sizes.get(part, 0) for part in parts)
        found[entry.name] = to_sympy(entry.value.tree, found)
        number = value(found[entry.name]) if sizes[entry.name] > _LONG else None
        if number is not None:
            sizes[entry.name] = 0
            found[entry.name] = sympy.Rational(number.numerator, number.denominator)
    return found


def partials(expression: Any) -> tuple[tuple[Any, Any], ...]:
    """(symbol, derivative) for every symbol on which an expression depends, by name. Of a sum term by term, each by the
    symbols that it has: a sum of many terms in many symbols is seen once, not once a symbol."""
    found: dict[Any, list[Any]] = {}
    slopes = _Slopes()
    for term in sympy.Add.make_args(expression):
        for symbol in slopes.symbols(term):
            found.setdefault(symbol, []).append(slopes.of(term, symbol))
    pairs = ((s, sympy.Add(*found[s])) for s in sorted(found, key=lambda s: s.name))
    return tuple((s, d) for s, d in pairs if d != 0)


class _Slopes:
    """Derivatives by SymPy's own rules, but for its care about what else a symbol might be, which takes most of the
    time; each part is asked only for the symbols that it has."""

    def __init__(self) -> None:
        self._symbols: dict[Any, frozenset[Any]] = {}

    def symbols(self, e: Any) -> frozenset[Any]:
        found = self._symbols.get(e)
        if found is None:
            found = frozenset({e}) if e.is_Symbol else frozenset().union(*map(self.symbols, e.args))
            self._symbols[e] = found
        return found

    def of(self, e: Any, s: Any) -> Any:
        """de/ds."""
        if s not in self.symbols(e):
            return sympy.S.Zero
        if e == s:
            return sympy.S.One
        if e.is_Add:
            return sympy.Add(*[self.of(a, s) for a in e.args])
        if e.is_Mul:
            slopes = [(i, self.of(a, s)) for i, a in enumerate(e.args)]
            return sympy.Add(*[self._product(e.args, i, d) for i, d in slopes if d != 0])
        if e.is_Pow and s not in self.symbols(e.exp):
            return e * (self.of(e.base, s) * e.exp / e.base)
        if isinstance(e, sympy.Function) and type(e)._eval_derivative is sympy.Function._eval_derivative:
            slopes = [(i, self.of(a, s)) for i, a in enumerate(e.args, 1)]
            return sympy.Add(*[e.fdiff(i) * d for i, d in slopes if d != 0])
        return e.diff(s)

    def _product(self, factors: tuple[Any, ...], i: int, slope: Any) -> Any:
        """Of factors with the i-th replaced, two by two: all at once SymPy makes another expression of it."""
        return reduce(mul, (*factors[:i], slope, *factors[i + 1 :]), sympy.S.One)


def _power(base: Any, exponent: Any) -> Any:
    if exponent == sympy.Rational(1, 2):
        return kf.root(base)
    if exponent == sympy.Rational(-1, 2):
        return 1 / kf.root(base)
    return base**exponent


def _table(x: Any, *data: Any) -> Any:
    """A table; where its values are no constants (a table of tables, say) their sum, each by its share of x."""
    count = len(data) // 2
    points, values = data[:count], data[count:]
    if not any(value.free_symbols for value in values):
        return kf.Table(x, *data)
    shares = [[sympy.Integer(i == k) for k in range(count)] for i in range(count)]
    return sympy.Add(*[value * kf.Table(x, *points, *share) for value, share in zip(values, shares, strict=True)])


_CALLS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": _power,
    "neg": lambda a: -a,
    "lt": kf.Less,
    "le": kf.LessEqual,
    "gt": lambda a, b: kf.Less(b, a),
    "ge": lambda a, b: kf.LessEqual(b, a),
    "and": kf.Both,
    "or": kf.Either,
    "not": kf.Negation,
    "sin": sympy.sin, "cos": sympy.cos, "tan": sympy.tan,
    "asin": sympy.asin, "acos": sympy.acos, "atan": sympy.atan, "atan2": kf.Atan2,
    "sinh": sympy.sinh, "cosh": sympy.cosh, "tanh": sympy.tanh,
    "exp": sympy.exp, "log": sympy.log,
    "sqrt": kf.root,
    "hypot": lambda a, b: kf.Norm(a, b),
    "abs": kf.Absolute,
    "sign": kf.Sign,
    "min": kf.Minimum,
    "max": kf.Maximum,
    "floor": kf.Floor,
    "where": kf.Where,
    "table": _table,
    "rotation": turning.entry,
    "rotation_vector": turning.rotation_vector,
    "from_rotation_vector": turning.from_rotation_vector,
}  # fmt: skip
