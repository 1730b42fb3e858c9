"""From a spec to its filter: which algorithm, which layout, which order of the states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import sympy

from kfgen.errors import Mistake, SpecError
from kfgen.filters import process
from kfgen.filters.base import FilterCode
from kfgen.filters.choice import choose, told, with_privates
from kfgen.filters.ekf import Ekf
from kfgen.filters.full import Full
from kfgen.filters.imm import Imm
from kfgen.filters.iterated import Iekf
from kfgen.filters.layout import GainChange, Layout
from kfgen.filters.looped import Kernels
from kfgen.filters.numbers import is_zero
from kfgen.filters.order import best_order
from kfgen.filters.rolled_full import RolledFull
from kfgen.filters.rolled_sqrt import RolledSqrt
from kfgen.filters.rolled_ud import RolledUD
from kfgen.filters.second import Ekf2
from kfgen.filters.sensor import SensorCode
from kfgen.filters.shared import unused
from kfgen.filters.sqrt import Sqrt
from kfgen.filters.steady import Steady
from kfgen.filters.ud import UD
from kfgen.filters.ukf import Ukf
from kfgen.filters.unbuilt import unbuilt
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

    Raises SpecError for what is not built yet and for what only the model can tell.
    """
    missing = unbuilt(spec)
    if missing:
        raise SpecError(missing)
    taken |= {f"{spec.name}_{word}" for word in _private_words(spec, scalar)}
    if spec.imm is not None:
        return _with_tables(_bank(spec, scalar).code(taken))
    model = build_model(spec)
    _check_measurements(model)
    if spec.filter.gain is not None:
        return _with_tables(Steady(model, scalar).code(taken))
    return _with_tables(with_privates(_unrolled_or_not(model, scalar, taken)))


def _unrolled_or_not(model: Model, scalar: Scalar, taken: frozenset[str]) -> FilterCode:
    """The filter in straight-line code or in loops, as `code` asks."""
    chosen, layout = model.spec.code, _layout(model, scalar)

    def emitted(unroll: str) -> FilterCode:
        asked = replace(model, spec=replace(model.spec, code=replace(chosen, unroll=unroll)))
        own = _rolled(model, layout, scalar, taken) if unroll == "none" else layout
        by_points = model.spec.filter.type == "ukf"
        filter_ = _FILTERS[model.spec.filter.type](asked, layout if by_points else own, scalar)
        filter_.plain = own
        code = filter_.code(taken)
        return replace(code, constants={**code.constants, **own.tables})

    if chosen.flash is None:
        code = emitted(chosen.unroll)
        return told(code, {f.name for f in code.functions}) if chosen.unroll == "none" else code
    straight = emitted(chosen.unroll)
    looped = emitted("none") if chosen.unroll == "auto" else straight
    return choose(straight, looped, chosen.flash, chosen.unroll == "none", scalar.name)


def _rolled(model: Model, layout: Layout, scalar: Scalar, taken: frozenset[str]) -> Layout:
    """The same layout in loops; where there is nothing to loop over, as it is."""
    if layout.n == 1:
        return layout
    names = [model.states[i] for i in layout.order]
    kernels = Kernels(scalar.smallest, taken)
    steps = model.options.adapt_Q is not None
    weighted = model.options.influence is not None
    if isinstance(layout, UD):
        return RolledUD(layout.order, layout.form, layout.change, names, kernels, weighted, steps, model.spec.name)
    if isinstance(layout, Sqrt):
        return RolledSqrt(layout.n, names, kernels, weighted, steps, model.spec.name)
    if isinstance(layout, Full):
        return RolledFull(layout, names, kernels, steps)
    return layout


def _single(model: Model, scalar: Scalar, order: list[int] | None = None) -> Ekf:
    return _FILTERS[model.spec.filter.type](model, _layout(model, scalar, order), scalar)


def _bank(spec: Spec, scalar: Scalar) -> Imm:
    bank = build_bank(spec)
    for model in bank.modes:
        _check_measurements(model)
    order = _common_order(bank.modes)
    return Imm(bank, [_single(model, scalar, order) for model in bank.modes], scalar)


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
    words = {*scalar.helper_ops, "order", "wm", "wc", "f", "absorb"}
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
