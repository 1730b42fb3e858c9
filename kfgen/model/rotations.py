"""Quaternions in the formulas of a model: R(q) and what it turns as definitions whose derivatives are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy

from kfgen.geometry import Rotation
from kfgen.spec import types
from kfgen.spec.tree import Call, Name, Number, Tree

Symbolic = Any  # a SymPy expression
Quartet = tuple[str, str, str, str]


@dataclass(frozen=True)
class RotationModel:
    """A quaternion among the states, or among the components of a sensor. first: the place of its number w;
    first_error: that of its first error coordinate."""

    name: str
    parts: Quartet
    errors: tuple[str, str, str]
    first: int
    first_error: int
    geometry: Rotation
    reset: bool


@dataclass(frozen=True)
class Turned:
    """What a hidden definition is: entry (i, j) of R(q), or, with a vector (3,), entry i of R v (R^T v: transposed)."""

    rotation: str
    i: int
    j: int = 0
    vector: tuple[Symbolic, Symbolic, Symbolic] | None = None
    transposed: bool = False


@dataclass
class Registry:
    """The hidden definitions of a model, made as its formulas are read. quartets: the numbers of each quaternion."""

    quartets: Mapping[Quartet, str]
    turned: dict[str, Turned] = field(default_factory=dict)
    values: dict[str, Symbolic] = field(default_factory=dict)
    _names: dict[Turned, str] = field(default_factory=dict)

    def entry(self, numbers: Sequence[Symbolic], i: int, j: int) -> Symbolic:
        """Entry (i, j) of R(q)."""
        name = self._known(numbers)
        if name is None:
            numbers, i, j = [numbers[0], *(-n for n in numbers[1:])], j, i
            name = self._known(numbers)
        if name is None:
            return entries(numbers)[i][j]
        return self._symbol(Turned(name, i, j), entries(numbers)[i][j])

    def _known(self, numbers: Sequence[Symbolic]) -> str | None:
        names = [n.name if n.is_Symbol else "" for n in numbers]
        return next((own for quartet, own in self.quartets.items() if list(quartet) == names), None)

    def found(self, symbol: Symbolic) -> Turned | None:
        return self.turned.get(symbol.name) if symbol.is_Symbol else None

    def rotated(self, name: str, i: int, vector: tuple[Symbolic, Symbolic, Symbolic], transposed: bool) -> Symbolic:
        """Entry i of R v, or of R^T v."""
        quartet = next(q for q, own in self.quartets.items() if own == name)
        numbers = [sympy.Symbol(part) for part in quartet]
        row = [self.entry(numbers, *((j, i) if transposed else (i, j))) for j in range(3)]
        total = sympy.Add(*[r * v for r, v in zip(row, vector, strict=True)])
        return self._symbol(Turned(name, i, 0, vector, transposed), total)

    def _symbol(self, what: Turned, value: Symbolic) -> Symbolic:
        found = self._names.get(what)
        if found is None:
            suffix = f"r{what.i}{what.j}" if what.vector is None else f"turned{len(self._names)}"
            found = self._names[what] = f"{what.rotation}.{suffix}"
            self.turned[found], self.values[found] = what, value
        return sympy.Symbol(found)


class Names(dict[str, Any]):
    """Names of a model with what they stand for, and the registry that its formulas go by."""

    def __init__(self, names: Mapping[str, Any], registry: Registry | None = None) -> None:
        super().__init__(names)
        self.registry = registry


def entries(numbers: Sequence[Symbolic]) -> list[list[Symbolic]]:
    """R(q) (3, 3) of a unit quaternion."""
    w, x, y, z = numbers
    return [
        [1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x**2 + z**2), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)],
    ]


def rotation_models(rotations: tuple[types.Rotation, ...], names: Sequence[str]) -> tuple[RotationModel, ...]:
    """Where the quaternions stand among states or components."""
    errors = types.error_names(names, rotations)
    return tuple(
        RotationModel(r.name, r.parts, r.errors, names.index(r.parts[0]), errors.index(r.errors[0]),
                      Rotation(r.error), r.reset)
        for r in rotations
    )  # fmt: skip


def gathered(registry: Registry, total: Symbolic) -> Symbolic:
    """A sum in which r_i0 a + r_i1 b + r_i2 c is the entry of a vector that R turns, or R^T."""
    groups: dict[tuple[str, int, bool], dict[int, Symbolic]] = {}
    terms = sympy.Add.make_args(total)
    of_term: list[tuple[Turned, Symbolic] | None] = []
    for term in terms:
        found = [(what, f) for f in sympy.Mul.make_args(term) if (what := registry.found(f)) and what.vector is None]
        if len(found) != 1:
            of_term.append(None)
            continue
        what, factor = found[0]
        rest = term / factor
        of_term.append(None if rest.has(factor) else (what, rest))
    for each in of_term:
        if each is not None:
            what, rest = each
            for found_key, place in (((what.rotation, what.i, False), what.j), ((what.rotation, what.j, True), what.i)):
                group = groups.setdefault(found_key, {})
                group[place] = group.get(place, 0) + rest
    chosen = {key: group for key, group in groups.items() if len(group) > 1}
    out, done = [], set()
    for term, each in zip(terms, of_term, strict=True):
        key: tuple[str, int, bool] | None = None
        if each is not None:
            what = each[0]
            keys = [(what.rotation, what.i, False), (what.rotation, what.j, True)]
            key = max((k for k in keys if k in chosen), key=lambda k: len(chosen[k]), default=None)
        if key is None:
            out.append(term)
        elif key not in done:
            done.add(key)
            name, i, transposed = key
            a, b, c = (sympy.sympify(chosen[key].get(j, 0)) for j in range(3))
            out.append(registry.rotated(name, i, (a, b, c), transposed))
    return sympy.Add(*out)


def increment(numbers: Sequence[Tree], parts: Quartet, lets: Mapping[str, Tree]) -> tuple[Tree, Tree, Tree] | None:
    """The v of a new quaternion q * from_rotation_vector(v), given by its four numbers; None: it is another one."""
    rows = []
    for tree in numbers:
        row: dict[str, tuple[int, Tree]] = {}
        for sign, term in _terms(tree, 1):
            factors = list(_factors(term))
            own = [f for f in factors if isinstance(f, Name) and f.name in parts]
            other = [f for f in factors if f not in own]
            if len(own) != 1 or len(other) != 1 or own[0].name in row:
                return None
            row[own[0].name] = (sign, other[0])
        rows.append(row)
    w, x, y, z = parts
    try:
        a, b, c, d = (rows[i][w] for i in range(4))
        right = [
            {w: a, x: _minus(b), y: _minus(c), z: _minus(d)},
            {w: b, x: a, y: d, z: _minus(c)},
            {w: c, x: _minus(d), y: a, z: b},
            {w: d, x: c, y: _minus(b), z: a},
        ]
    except KeyError:
        return None
    if rows != right or any(sign < 0 for sign, _ in (a, b, c, d)):
        return None
    found = [_resolved(tree, lets) for _, tree in (a, b, c, d)]
    for k, call in enumerate(found):
        if not isinstance(call, Call) or call.op != "from_rotation_vector" or call.args[0] != Number(Fraction(k)):
            return None
    first = found[0]
    assert isinstance(first, Call)
    vector = first.args[1:]
    if any(isinstance(call, Call) and call.args[1:] != vector for call in found):
        return None
    return (vector[0], vector[1], vector[2])


def _minus(term: tuple[int, Tree]) -> tuple[int, Tree]:
    return -term[0], term[1]


def _resolved(tree: Tree, lets: Mapping[str, Tree]) -> Tree:
    while isinstance(tree, Name) and tree.name in lets:
        tree = lets[tree.name]
    return tree


def _terms(tree: Tree, sign: int) -> Iterator[tuple[int, Tree]]:
    if isinstance(tree, Call) and tree.op in ("add", "sub"):
        yield from _terms(tree.args[0], sign)
        yield from _terms(tree.args[1], sign if tree.op == "add" else -sign)
    elif isinstance(tree, Call) and tree.op == "neg":
        yield from _terms(tree.args[0], -sign)
    else:
        yield sign, tree


def _factors(tree: Tree) -> Iterator[Tree]:
    if isinstance(tree, Call) and tree.op == "mul":
        yield from _factors(tree.args[0])
        yield from _factors(tree.args[1])
    else:
        yield tree
