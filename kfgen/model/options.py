"""The options of a filter as exact numbers and symbolic functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from kfgen.spec.tree import Expression
from kfgen.spec.types import Adaptive, Filter, Gate, Robust, SigmaPoints

Symbolic = Any  # a SymPy expression
INNOVATION = sympy.Symbol("e")  # what psi is a function of
_ADAPTIVE = Fraction(999, 1000)
_ADAPTIVE_ROBUST = Fraction(997, 1000)


@dataclass(frozen=True)
class Influence:
    """The influence function of a robust update: chernodarov, huber with its k, or psi and psi' in INNOVATION."""

    kind: str
    k: Fraction | None = None
    psi: Symbolic = None
    slope: Symbolic = None


@dataclass(frozen=True)
class Inflation:
    """The test of an adaptive update: the quantile of a probability, or a threshold that was given."""

    probability: Fraction
    threshold: Fraction | None


@dataclass(frozen=True)
class GateModel:
    """The test of a whole vector: the quantile of a probability, or (probability None) a threshold, a formula."""

    probability: Fraction | None
    threshold: Symbolic = None


@dataclass(frozen=True)
class Points:
    """Sigma points: parameters of a kind, or rows (K, n) with their weights. kappa None: the dimension."""

    kind: str
    redraw: bool
    alpha: Fraction = Fraction(1)
    beta: Fraction = Fraction(2)
    kappa: Fraction | None = None
    rows: tuple[tuple[Fraction, ...], ...] = ()
    wm: tuple[Fraction, ...] = ()
    wc: tuple[Fraction, ...] = ()


@dataclass(frozen=True)
class Options:
    """Options of a filter; None: off. consider: indices of states."""

    influence: Influence | None = None
    inflation: Inflation | None = None
    adapt_R: Fraction | None = None
    adapt_Q: Fraction | None = None
    innovation_floor: Fraction | None = None
    gain_limit: Fraction | None = None
    consider: frozenset[int] = frozenset()
    points: Points | None = None
    rejects: bool = False  # a sigma point that is not finite
    reject: Symbolic = None  # or for which this condition holds


def build_options(
    chosen: Filter,
    states: list[str],
    number: Callable[[Expression], Fraction],
    symbolic: Callable[[Expression], Symbolic],
) -> Options:
    """number: the value of a constant expression; symbolic: a formula, with INNOVATION for `e`."""

    def optional(expression: Expression | None) -> Fraction | None:
        return None if expression is None else number(expression)

    return Options(
        influence=None if chosen.robust is None else _influence(chosen.robust, number, symbolic),
        inflation=None if chosen.adaptive is None else _inflation(chosen.adaptive, chosen.robust is not None, optional),
        adapt_R=optional(chosen.adapt_R),
        adapt_Q=optional(chosen.adapt_Q),
        innovation_floor=optional(chosen.innovation_floor),
        gain_limit=optional(chosen.gain_limit),
        consider=frozenset(states.index(name) for name in chosen.consider),
        points=None if chosen.sigma_points is None else _points(chosen.sigma_points, number, optional),
        rejects=chosen.reject is not None,
        reject=symbolic(chosen.reject) if isinstance(chosen.reject, Expression) else None,
    )


def build_gate(
    gate: Gate | None, number: Callable[[Expression], Fraction], symbolic: Callable[[Expression], Symbolic]
) -> GateModel | None:
    if gate is None:
        return None
    if gate.threshold is not None:
        return GateModel(None, symbolic(gate.threshold))
    assert gate.probability is not None
    return GateModel(number(gate.probability))


def _points(
    chosen: SigmaPoints,
    number: Callable[[Expression], Fraction],
    optional: Callable[[Expression | None], Fraction | None],
) -> Points:
    alpha, beta = optional(chosen.alpha), optional(chosen.beta)
    return Points(
        chosen.kind,
        chosen.redraw,
        Fraction(1) if alpha is None else alpha,
        Fraction(2) if beta is None else beta,
        optional(chosen.kappa),
        tuple(tuple(number(e) for e in row) for row in chosen.points or ()),
        tuple(number(e) for e in chosen.wm or ()),
        tuple(number(e) for e in chosen.wc or ()),
    )


def _influence(
    robust: Robust, number: Callable[[Expression], Fraction], symbolic: Callable[[Expression], Symbolic]
) -> Influence:
    if robust.psi is None:
        return Influence(robust.influence, None if robust.k is None else number(robust.k))
    psi = symbolic(robust.psi)
    slope = psi.diff(INNOVATION) if robust.psi_dot is None else symbolic(robust.psi_dot)
    return Influence("custom", None, psi, slope)


def _inflation(adaptive: Adaptive, robust: bool, optional: Callable[[Expression | None], Fraction | None]) -> Inflation:
    default = _ADAPTIVE_ROBUST if robust else _ADAPTIVE
    probability = optional(adaptive.probability)
    return Inflation(default if probability is None else probability, optional(adaptive.chi2))
