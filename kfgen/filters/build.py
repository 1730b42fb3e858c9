"""From a spec to its filter: which algorithm, which layout, which order of the states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import sympy

from kfgen.errors import Mistake, SpecError
from kfgen.filters import kinds, sigma
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.bank.imm import Imm
from kfgen.filters.base import FilterCode
from kfgen.filters.choice import choose, mixed, told, with_privates
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.forms import Choice, looped, straight
from kfgen.filters.covariance.kernels.function import Kernels
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.parts import GainChange
from kfgen.filters.frame.shared import unused
from kfgen.filters.kinds.single import SingleFilter
from kfgen.filters.kinds.steady import Steady
from kfgen.filters.order import best_order, upper_order
from kfgen.filters.steps import process
from kfgen.filters.steps.sensor import SensorCode
from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import roots, walk
from kfgen.ir.trace import Trace
from kfgen.model import Model, build_model
from kfgen.model.bank import build_bank
from kfgen.scalars import Scalar
from kfgen.spec.constants import value
from kfgen.spec.types import Spec


@cache
def filters() -> Mapping[str, Callable[[Model, Any, Scalar], SingleFilter]]:
    """Filter type -> the filter: what the modules of `kinds` and `sigma` name in a table FILTERS."""
    found: dict[str, Callable[[Model, Any, Scalar], SingleFilter]] = {}
    for room in (kinds, sigma):
        for module in sorted(iter_modules(room.__path__), key=lambda each: each.name):
            found |= getattr(import_module(f"{room.__name__}.{module.name}"), "FILTERS", {})
    return found


def build_filter(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> FilterCode:
    """The filter of a spec. taken: names that locals must not have.

    Raises SpecError for what only the model can tell.
    """
    taken |= {f"{spec.name}_{word}" for word in _private_words(spec, scalar)}
    emitted = _bank(spec, scalar, taken) if spec.imm is not None else _single(spec, scalar, taken)
    return _with_tables(with_privates(_unrolled_or_not(spec, scalar, emitted)))


Emitter = Callable[[str], FilterCode]
"""From full, auto or none to the filter's code."""


def _unrolled_or_not(spec: Spec, scalar: Scalar, emitted: Emitter) -> FilterCode:
    """The filter in straight-line code or in loops, as `code` asks."""
    chosen = spec.code
    if spec.filter.gain is not None or not scalar.uniform:
        return emitted("auto")
    if chosen.unroll_by:
        asked = {how: {name for name, own in chosen.unroll_by.items() if own == how} for how in ("full", "none")}
        straight = emitted("auto")
        if asked["full"]:
            straight = mixed(straight, emitted("full"), asked["full"])
        return choose(straight, emitted("none"), chosen.flash, asked["none"], asked["full"], _rates(spec), scalar.name)
    if chosen.flash is None:
        code = emitted(chosen.unroll)
        return told(code, {f.name for f in code.functions}) if chosen.unroll == "none" else code
    straight = emitted(chosen.unroll)
    looped = emitted("none") if chosen.unroll == "auto" else straight
    names = {f.name for f in straight.functions} if chosen.unroll == "none" else set()
    return choose(straight, looped, chosen.flash, names, set(), _rates(spec), scalar.name)


def _rates(spec: Spec) -> dict[str, float]:
    """Function -> its calls a prediction."""
    return {f"update_{s.name}": float(value(s.rate.tree, spec)) for s in spec.measurements if s.rate is not None}


def _single(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> Emitter:
    """A filter by itself."""
    model = build_model(spec)
    _check_measurements(model)
    if spec.filter.gain is not None:
        return lambda unroll: Steady(model, scalar).code(taken)
    form = _form(model, scalar)

    def emitted(unroll: str) -> FilterCode:
        (own,) = _in_loops((model,), [form], scalar, taken) if unroll == "none" else [form]
        return _filter(model, own, scalar, unroll).code(taken)

    return emitted


def _bank(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> Emitter:
    """A filter of several modes."""
    bank = build_bank(spec)
    for model in bank.modes:
        _check_measurements(model)
    order = _common_order(bank.modes)
    forms = [_form(model, scalar, order) for model in bank.modes]

    def emitted(unroll: str) -> FilterCode:
        own = _in_loops(bank.modes, forms, scalar, taken, bank.names) if unroll == "none" else forms
        filters = [_filter(model, form, scalar, unroll) for model, form in zip(bank.modes, own, strict=True)]
        return Imm(bank, filters, scalar).code(taken)

    return emitted


def _filter(model: Model, form: Form[Any], scalar: Scalar, unroll: str) -> SingleFilter:
    """The filter of one model. unroll: what is asked for, in place of the spec's."""
    spec = model.spec
    asked = replace(model, spec=replace(spec, code=replace(spec.code, unroll=unroll)))
    return filters()["sequential" if spec.filter.sequential else spec.filter.type](asked, form, scalar)


def _in_loops(
    models: tuple[Model, ...], forms: Sequence[Form[Any]], scalar: Scalar, taken: frozenset[str],
    modes: tuple[str, ...] = (),
) -> list[Form[Any]]:  # fmt: skip
    """The same forms in loops, which share their private functions; where there is nothing to loop over, as they
    are."""
    if forms[0].n == 1:
        return list(forms)
    kernels = Kernels(scalar.smallest, taken, several=len(models) > 1)
    steps = any(model.options.adapt_Q is not None for model in models)
    weighted = any(o.influence is not None for model in models for o in model.every_options)
    out = []
    for place, (model, form) in enumerate(zip(models, forms, strict=True)):
        names = [model.errors[i] for i in form.order]
        table = (model.spec.name, f"reach_{modes[place]}" if modes else "reach")
        how = Looping(names, kernels, weighted, steps, table)
        out.append(looped(model.spec.filter.covariance, form, how))
    return out


def _form(model: Model, scalar: Scalar, order: list[int] | None = None) -> Form[Any]:
    """How the covariance is kept, in straight-line code. order: of the states inside, where that is given."""
    n, chosen = len(model.errors), model.spec.filter

    def ordered() -> list[int]:
        if chosen.type == "ukf":  # sigma points depend on the order
            return list(range(n))
        return _order((model,)) if order is None else order

    change = partial(_gain_change, model)
    choice = Choice(n, chosen.update, scalar.epsilon, not scalar.uniform, ordered, change)
    return straight(chosen.covariance, choice)


def _gain_change(model: Model, order: list[int]) -> GainChange | None:
    """What `consider` and `gain_limit` make of a gain in the filter's inner order."""
    options = model.options
    if options.gain_limit is None and not options.consider:
        return None

    considered = frozenset(place for place, i in enumerate(order) if i in options.consider)
    return GainChange(considered, options.gain_limit)


def _check_measurements(model: Model) -> None:
    """A component whose row of H is zero measures nothing."""
    mistakes = []
    for sensor in model.sensors:
        rows = linearise_rows(Trace(), model, sensor)
        components = {c.name: c for c in sensor.spec.components}
        components |= {e: components[r.parts[0]] for r in sensor.rotations for e in r.errors}
        for name, row in zip(sensor.errors, rows, strict=True):
            component = components[name]
            if all(is_zero(h) for h in row):
                mistakes.append(
                    Mistake(
                        component.h.place,
                        f"`{component.h.text}` does not depend on any state",
                        "measure a state",
                    )
                )
    if mistakes:
        raise SpecError(mistakes)


def linearise_rows(t: Trace, model: Model, sensor: Any) -> list[list[Any]]:
    """H alone, before decorrelation."""
    m, q = sensor.dimension, len(sensor.noises)
    plain = replace(
        sensor, R=((sympy.S.Zero,) * m,) * m, noise_covariance=((sympy.S.Zero,) * q,) * q,
        residual=(None,) * len(sensor.h),
    )  # fmt: skip
    code = SensorCode(t, model, plain, list(range(len(model.errors))))
    return code.linearise(code.prior()).H


def _common_order(models: tuple[Model, ...]) -> list[int]:
    """One order for all modes of a bank: factors of the same order mix for the least."""
    if any(model.spec.filter.type == "ukf" and model.spec.filter.covariance == "ud" for model in models):
        return list(range(len(models[0].errors)))
    return _order(models)


def _order(models: tuple[Model, ...]) -> list[int]:
    """The cheapest inner order."""
    n = len(models[0].errors)
    if n == 1:
        return list(range(n))
    F: list[set[int]] = [set() for _ in range(n)]
    noisy: set[int] = set()
    measured: list[set[int]] = []
    for model in models:
        t = Trace()
        step = process.step_length(t, model)
        result = process.advance(t, model, process.given(t, model, step), step)
        for i in range(n):
            F[i] |= {j for j in range(n) if not is_zero(result.F[i][j])}
        noisy |= {i for i in range(n) if any(not is_zero(q) for q in result.Q[i])}
        for sensor in model.sensors:
            for row in linearise_rows(Trace(), model, sensor):
                touched = {j for j in range(n) if not is_zero(row[j])}
                if model is models[0] or touched not in measured:
                    measured.append(touched)
    if models[0].rotations:
        blocks = [range(r.first_error, r.first_error + 3) for r in models[0].rotations]
        found = upper_order(F, blocks)
        if found is not None:  # of a full covariance what others use is stored first
            return found[::-1] if models[0].spec.filter.covariance == "full" else found
    return best_order(F, noisy, measured)


def _private_words(spec: Spec, scalar: Scalar) -> set[str]:
    """What follows the filter's name in the names of its helpers, private functions and tables."""
    words = {*scalar.helper_ops, "order", "wm", "wc", "f", "absorb", "reach", "draws", "settle", "isolate"}
    words |= {"isolate_root"}
    words |= {f"{kind}_{sensor.name}" for kind in ("h", "see", "recall") for sensor in spec.measurements}
    modes = spec.imm.modes if spec.imm else ()
    return words | {f"{word}_{mode.name}" for word in words for mode in modes}


def _with_tables(code: FilterCode) -> FilterCode:
    """Number the tables that the functions use, in the order of their first use."""
    found: dict[Table, str] = {}
    lookups: dict[Constants, str] = {}
    for function in code.functions:
        for statement in walk(function.body):
            stack = list(reversed(roots(statement)))
            while stack:
                node = stack.pop()
                if node.op == "variable" or node.op == "const":
                    continue
                data = node.data
                if isinstance(data, Table):
                    found.setdefault(data, f"table{len(found)}")
                elif isinstance(data, Constants) and data not in lookups:
                    lookups[data] = unused(data.name, set(lookups.values()))
                stack += node.args[::-1]
    return replace(code, tables=found, lookups=lookups)
