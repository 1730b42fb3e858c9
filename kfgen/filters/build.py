"""From a spec to its filter: which algorithm, which layout, which order of the states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import sympy

from kfgen.errors import Mistake, SpecError
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.bank.imm import Imm
from kfgen.filters.base import FilterCode
from kfgen.filters.choice import choose, told, with_privates
from kfgen.filters.covariance.base import GainChange, Layout
from kfgen.filters.covariance.full.loops import RolledFull
from kfgen.filters.covariance.full.straight import Full
from kfgen.filters.covariance.looped import Kernels
from kfgen.filters.covariance.sqrt.loops import RolledSqrt
from kfgen.filters.covariance.sqrt.straight import Sqrt
from kfgen.filters.covariance.ud.loops import RolledUD
from kfgen.filters.covariance.ud.straight import UD
from kfgen.filters.frame.shared import unused
from kfgen.filters.kinds.ekf import Ekf
from kfgen.filters.kinds.ekf2 import Ekf2
from kfgen.filters.kinds.iekf import Iekf
from kfgen.filters.kinds.steady import Steady
from kfgen.filters.order import best_order
from kfgen.filters.sigma.ukf import Ukf
from kfgen.filters.steps import process
from kfgen.filters.steps.sensor import SensorCode
from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import roots, walk
from kfgen.ir.trace import Trace
from kfgen.model import Model, build_model
from kfgen.model.bank import build_bank
from kfgen.scalars import Scalar
from kfgen.spec.types import Spec

_FILTERS: dict[str, Callable[[Model, Layout, Scalar], Ekf]] = {
    "kf": Ekf, "ekf": Ekf, "iekf": Iekf, "ekf2": Ekf2, "ukf": Ukf,
}  # fmt: skip


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
    if chosen.flash is None:
        code = emitted(chosen.unroll)
        return told(code, {f.name for f in code.functions}) if chosen.unroll == "none" else code
    straight = emitted(chosen.unroll)
    looped = emitted("none") if chosen.unroll == "auto" else straight
    return choose(straight, looped, chosen.flash, chosen.unroll == "none", scalar.name)


def _single(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> Emitter:
    """A filter by itself."""
    model = build_model(spec)
    _check_measurements(model)
    if spec.filter.gain is not None:
        return lambda unroll: Steady(model, scalar).code(taken)
    layout = _layout(model, scalar)

    def emitted(unroll: str) -> FilterCode:
        own = _rolled((model,), [layout], scalar, taken)[0] if unroll == "none" else layout
        code = _filter(model, layout, own, scalar, unroll).code(taken)
        return replace(code, constants={**code.constants, **own.tables})

    return emitted


def _bank(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> Emitter:
    """A filter of several modes."""
    bank = build_bank(spec)
    for model in bank.modes:
        _check_measurements(model)
    order = _common_order(bank.modes)
    layouts = [_layout(model, scalar, order) for model in bank.modes]

    def emitted(unroll: str) -> FilterCode:
        own = _rolled(bank.modes, layouts, scalar, taken, bank.names) if unroll == "none" else layouts
        filters = [
            _filter(model, layout, rolled, scalar, unroll)
            for model, layout, rolled in zip(bank.modes, layouts, own, strict=True)
        ]
        code = Imm(bank, filters, layouts, scalar).code(taken)
        tables = {name: table for layout in own for name, table in layout.tables.items()}
        return replace(code, constants={**code.constants, **tables})

    return emitted


def _filter(model: Model, layout: Layout, own: Layout, scalar: Scalar, unroll: str) -> Ekf:
    """own: the layout, in loops if asked for; sigma points come from the layout as it is."""
    spec = model.spec
    asked = replace(model, spec=replace(spec, code=replace(spec.code, unroll=unroll)))
    filter_ = _FILTERS[spec.filter.type](asked, layout if spec.filter.type == "ukf" else own, scalar)
    filter_.plain = own
    return filter_


def _rolled(
    models: tuple[Model, ...], layouts: list[Layout], scalar: Scalar, taken: frozenset[str], modes: tuple[str, ...] = ()
) -> list[Layout]:
    """The same layouts in loops, which share their private functions; where there is nothing to loop over, as they
    are."""
    if layouts[0].n == 1:
        return layouts
    kernels = Kernels(scalar.smallest, taken, several=len(models) > 1)
    steps = any(model.options.adapt_Q is not None for model in models)
    weighted = any(model.options.influence is not None for model in models)
    out: list[Layout] = []
    for place, (model, layout) in enumerate(zip(models, layouts, strict=True)):
        names = [model.states[i] for i in layout.order]
        table = (model.spec.name, f"reach_{modes[place]}" if modes else "reach")
        if isinstance(layout, UD):
            layout = RolledUD(layout.order, layout.form, layout.change, names, kernels, weighted, steps, table)
        elif isinstance(layout, Sqrt):
            layout = RolledSqrt(layout.n, names, kernels, weighted, steps, table)
        elif isinstance(layout, Full):
            layout = RolledFull(layout, names, kernels, steps)
        out.append(layout)
    return out


def _layout(model: Model, scalar: Scalar, order: list[int] | None = None) -> Layout:
    """How the covariance is kept, and in which order of the states, where that is not given."""
    n, chosen = len(model.states), model.spec.filter
    if chosen.covariance == "sqrt":
        return Sqrt(n)
    if chosen.type == "ukf":  # sigma points depend on the order
        straight = list(range(n))
        return UD(straight, "bierman") if chosen.covariance == "ud" else Full(n, "standard", scalar.epsilon, straight)
    assert chosen.update is not None
    if order is None:
        order = _order((model,))
    if chosen.covariance == "ud":
        return UD(order, chosen.update, _gain_change(model, order))
    return Full(n, chosen.update, scalar.epsilon, order, _gain_change(model, list(range(n))))


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
        for component, row in zip(sensor.spec.components, rows, strict=True):
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
    m, q = len(sensor.h), len(sensor.noises)
    plain = replace(
        sensor, R=((sympy.S.Zero,) * m,) * m, noise_covariance=((sympy.S.Zero,) * q,) * q, residual=(None,) * m,
    )  # fmt: skip
    code = SensorCode(t, model, plain, list(range(len(model.states))))
    return code.linearise(code.prior()).H


def _common_order(models: tuple[Model, ...]) -> list[int]:
    """One order for all modes of a bank: factors of the same order mix for the least."""
    if any(model.spec.filter.type == "ukf" and model.spec.filter.covariance == "ud" for model in models):
        return list(range(len(models[0].states)))
    return _order(models)


def _order(models: tuple[Model, ...]) -> list[int]:
    """The cheapest inner order; the spec's where D is limited, since D depends on the order."""
    n = len(models[0].states)
    if n == 1 or any(v is not None for model in models for v in (*model.floors, *model.ceilings)):
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
    return best_order(F, noisy, measured)


def _private_words(spec: Spec, scalar: Scalar) -> set[str]:
    """What follows the filter's name in the names of its helpers, private functions and tables."""
    words = {*scalar.helper_ops, "order", "wm", "wc", "f", "absorb", "reach", "draws"}
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
                if isinstance(node.data, Table):
                    found.setdefault(node.data, f"table{len(found)}")
                if isinstance(node.data, Constants) and node.data not in lookups:
                    lookups[node.data] = unused(node.data.name, set(lookups.values()))
                stack += reversed(node.args)
    return replace(code, tables=found, lookups=lookups)
