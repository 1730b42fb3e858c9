"""A spec in which the numbers that are tuned are run-time parameters: one compilation serves all values of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from typing import Any

from kfgen.errors import KfgenError, Place
from kfgen.spec.expressions import parse
from kfgen.spec.lexer import tokenize
from kfgen.spec.parts import expressions
from kfgen.spec.tree import Call, Expression, Name, Number, Tree, names
from kfgen.spec.types import Parameter, Spec
from kfgen.tuning.numbers import START, Slot, names_at, plain_path


@dataclass(frozen=True)
class Opened:
    """A spec whose slots are run-time parameters: names, of each slot, several where one number stands for a vector;
    start: whether x0 or P0 depend on them."""

    spec: Spec
    names: tuple[tuple[str, ...], ...]
    start: bool

    def named(self, numbers: Sequence[float]) -> dict[str, float]:
        """The parameters of a number per slot."""
        pairs = zip(self.names, numbers, strict=True)
        return {name: float(number) for names, number in pairs for name in names}


def opened(spec: Spec, slots: list[Slot]) -> Opened:
    """Each slot becomes a parameter: one compilation serves all values of them. KfgenError where one cannot."""
    taken = {name for each in expressions(spec) for name in names(each.tree)} | {p.name for p in spec.parameters}
    hidden: list[tuple[str, ...]] = []
    by_place: dict[tuple[int, int], tuple[str, Slot, int | None]] = {}
    moved: dict[str, Tree] = {}  # constants that are none any more, and what they are
    for i, slot in enumerate(slots):
        top, named = plain_path(slot.place.path).partition(".")[0], names_at(spec, slot.place)
        if top == "parameters":
            hidden.append(named)
            continue
        name = f"tuned_{i + 1}"
        while name in taken:
            name += "_"
        hidden.append((name,))
        moved |= {each: Name(name) for each in named}
        if top != "constants":
            by_place |= {(place.line, place.column): (name, slot, literal) for place, literal in slot.spots}
    kept = []
    for constant in spec.constants:
        if constant.name in moved:
            continue
        tree = substituted(constant.value.tree, moved)
        if tree == constant.value.tree:
            kept.append(constant)
        else:
            moved[constant.name] = tree

    def change(expression: Expression) -> Expression:
        tree = substituted(expression.tree, moved)
        found = by_place.get((expression.place.line, expression.place.column))
        if found is not None:
            name, slot, literal = found
            raw = parse(expression.text)
            put: Tree = Name(name) if literal is None else _put(expression.text, raw, literal, name)
            changed = _exchanged(tree, substituted(raw, moved), substituted(put, moved))
            if changed == tree:
                raise KfgenError(
                    f"{slot.path}: `{expression.text}` is made of vectors; name the number that is meant, in parameters"
                )
            tree = changed
        return expression if tree == expression.tree else replace(expression, tree=tree)

    changed: Spec = _mapped(replace(spec, constants=tuple(kept)), change)
    values = {name: slot.value for names, slot in zip(hidden, slots, strict=True) for name in names}
    for before, after in zip(spec.parameters, changed.parameters, strict=True):
        if before.value.tree != after.value.tree:
            raise KfgenError(f"parameters.{before.name} is computed from a number that is to be tuned: tune it instead")
    own = [p for p in changed.parameters if p.name not in values]
    new = [p for p in changed.parameters if p.name in values]
    new += [_parameter(name) for name in values if name not in {p.name for p in changed.parameters}]
    new = [replace(p, value=_exactly(values[p.name], p.value.place)) for p in new]
    changed = replace(changed, parameters=(*own, *new))
    lets = {d.name: d.value.tree for d in changed.let}
    first = [*expressions(changed.states), *expressions(changed.covariances), *expressions(changed.P0 or ())]
    first = [each for each in first if START.search(each.place.path)]
    used = {name for each in first for name in names(substituted(each.tree, lets))}
    return Opened(changed, tuple(hidden), bool(used & values.keys()))


def with_values(opened: Opened, values: Mapping[str, float]) -> Spec:
    """The opened spec with other values of its parameters."""
    parameters = tuple(
        replace(p, value=_exactly(values[p.name], p.value.place)) if p.name in values else p
        for p in opened.spec.parameters
    )
    return replace(opened.spec, parameters=parameters)


def _parameter(name: str) -> Parameter:
    return Parameter(name, Expression(Number(Fraction(0)), "0", Place()))


def _exactly(number: float, place: Place) -> Expression:
    return Expression(Number(Fraction(number)), repr(number), place)


def substituted(tree: Tree, what: Mapping[str, Tree]) -> Tree:
    """A tree with trees in place of names."""
    if isinstance(tree, Name):
        return what.get(tree.name, tree)
    if isinstance(tree, Call):
        return Call(tree.op, tuple(substituted(each, what) for each in tree.args))
    return tree


def _put(text: str, raw: Tree, literal: int, name: str) -> Tree:
    """The tree of a text with a name in place of one of its numbers."""
    tokens = [token for token in tokenize(text) if token.kind == "number"]
    token = tokens[literal]
    return parse(f"{text[: token.offset]}{name}{text[token.offset + len(token.text) :]}")


def _exchanged(tree: Tree, old: Tree, new: Tree) -> Tree:
    if tree == old:
        return new
    if isinstance(tree, Call):
        return Call(tree.op, tuple(_exchanged(each, old, new) for each in tree.args))
    return tree


def _mapped(part: Any, change: Callable[[Expression], Expression]) -> Any:
    if isinstance(part, Expression):
        return change(part)
    if isinstance(part, Mapping):
        return {key: _mapped(each, change) for key, each in part.items()}
    if isinstance(part, tuple):
        return tuple(_mapped(each, change) for each in part)
    if is_dataclass(part) and not isinstance(part, (Place, type)):
        return replace(part, **{entry.name: _mapped(getattr(part, entry.name), change) for entry in fields(part)})
    return part
