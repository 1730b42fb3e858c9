"""The value of a constant expression, and what is known where a spec's constants are."""

from __future__ import annotations

from collections.abc import Mapping

import mpmath

from kfgen.errors import KfgenError
from kfgen.spec.operations import DIGITS, NoValue, Value, applied, less
from kfgen.spec.tree import Call, Name, Number, Tree
from kfgen.spec.types import Spec


class NotConstant(KfgenError):  # noqa: N818 - a finding about a formula, which callers expect
    """The expression has a name without a value; `name` is that name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"`{name}` has no constant value")
        self.name = name


def value(tree: Tree, environment: Spec | Mapping[str, Value] | None = None) -> Value:
    """The value of a tree in which every name is constant; NotConstant or NoValue where there is none."""
    names = environment_of(environment) if isinstance(environment, Spec) else environment or {}
    try:
        with mpmath.workdps(DIGITS):
            return _value(tree, names)
    except ArithmeticError:  # the operations look after themselves; this is for what mpmath may still refuse
        raise NoValue("the expression has no finite real value", "correct it") from None


def environment_of(spec: Spec, folded: bool = True) -> dict[str, Value]:
    """The values of a spec's constants and fixed dt; with `folded` also of its parameters."""
    known: dict[str, Value] = {}
    for constant in spec.constants:
        keep(known, constant.name, constant.value.tree)
    if spec.dt is not None and not spec.dt.run_time:
        keep(known, "dt", spec.dt.nominal.tree)
    return with_parameters(spec, known) if folded else known


def with_parameters(spec: Spec, known: Mapping[str, Value]) -> dict[str, Value]:
    """Beside what is known, the spec values of the parameters."""
    found = dict(known)
    for parameter in spec.parameters:
        keep(found, parameter.name, parameter.value.tree, known)
    return found


def keep(known: dict[str, Value], name: str, tree: Tree, using: Mapping[str, Value] | None = None) -> None:
    """Store a value where there is one; a mistake of the expression is reported elsewhere."""
    try:
        known[name] = value(tree, known if using is None else using)
    except (NotConstant, NoValue):
        known.pop(name, None)


def _value(tree: Tree, names: Mapping[str, Value]) -> Value:
    if isinstance(tree, Number):
        return tree.value
    if isinstance(tree, Name):
        return _name(tree.name, names)
    if tree.op == "where":
        return _value(tree.args[1] if truth(tree.args[0], names) else tree.args[2], names)
    arguments = [_value(argument, names) for argument in tree.args]
    return applied(tree.op, arguments)


def _name(name: str, names: Mapping[str, Value]) -> Value:
    if name in names:
        return names[name]
    if name == "pi":
        return +mpmath.pi
    if name == "e":
        return +mpmath.e
    raise NotConstant(name)


def truth(tree: Tree, names: Mapping[str, Value]) -> bool:
    """Whether a condition holds."""
    if not isinstance(tree, Call):
        raise NoValue("a condition is wanted")
    if tree.op == "not":
        return not truth(tree.args[0], names)
    if tree.op == "and":
        return truth(tree.args[0], names) and truth(tree.args[1], names)
    if tree.op == "or":
        return truth(tree.args[0], names) or truth(tree.args[1], names)
    left, right = _value(tree.args[0], names), _value(tree.args[1], names)
    return less(left, right, tree.op == "le") if tree.op in ("lt", "le") else less(right, left, tree.op == "ge")
