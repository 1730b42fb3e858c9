"""From a spec to its filter: which algorithm, which layout, which order of the states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sympy

from kfgen.errors import Mistake, SpecError
from kfgen.filters import process
from kfgen.filters.base import FilterCode
from kfgen.filters.ekf import Ekf
from kfgen.filters.full import Full
from kfgen.filters.layout import Layout
from kfgen.filters.numbers import is_zero
from kfgen.filters.order import best_order
from kfgen.filters.sensor import linearise
from kfgen.filters.ud import UD
from kfgen.filters.unbuilt import unbuilt
from kfgen.ir.nodes import Table
from kfgen.ir.program import roots, walk
from kfgen.ir.trace import Trace
from kfgen.model import Model, build_model
from kfgen.scalars import Scalar
from kfgen.spec.types import Spec


def build_filter(spec: Spec, scalar: Scalar, taken: frozenset[str]) -> FilterCode:
    """The filter of a spec. taken: names that locals must not have.

    Raises SpecError for what is not built yet and for what only the model can tell.
    """
    missing = unbuilt(spec)
    if missing:
        raise SpecError(missing)
    model = build_model(spec)
    _check_measurements(model)
    n = len(model.states)
    update = spec.filter.update
    assert update is not None
    best = _order(model)
    layout: Layout = UD(n, update) if spec.filter.covariance == "ud" else Full(n, update, scalar.epsilon, best)
    order = best if layout.reorders else list(range(n))
    code = Ekf(model, layout, order, scalar).code(taken)
    return _with_tables(code)


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
    return linearise(t, model, plain).rows


def _order(model: Model) -> list[int]:
    """The cheapest inner order; the spec's where D is limited, since D depends on the order."""
    n = len(model.states)
    if any(v is not None for v in (*model.floors, *model.ceilings)) or n == 1:
        return list(range(n))
    t = Trace()
    step = process.step_length(t, model)
    result = process.advance(t, model, process.given(t, model, step), step)
    F = [{j for j in range(n) if not is_zero(result.F[i][j])} for i in range(n)]
    noisy = {i for i in range(n) if any(not is_zero(q) for q in result.Q[i])}
    measured = []
    for sensor in model.sensors:
        for row in linearise_rows(Trace(), model, sensor):
            measured.append({j for j in range(n) if not is_zero(row[j])})
    return best_order(F, noisy, measured)


def _with_tables(code: FilterCode) -> FilterCode:
    """Number the tables that the functions use, in the order of their first use."""
    found: dict[Table, str] = {}
    for function in code.functions:
        for statement in walk(function.body):
            stack = list(reversed(roots(statement)))
            while stack:
                node = stack.pop()
                if isinstance(node.data, Table):
                    found.setdefault(node.data, f"table{len(found)}")
                stack += reversed(node.args)
    return replace(code, tables=found)
