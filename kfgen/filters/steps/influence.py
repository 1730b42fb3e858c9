"""Influence functions: a robust update weighs an innovation down by what it says itself (Huber 1964;
Chernodarov et al.; as a generalised linear model: Fahrmeir & Kaufmann 1991)."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.numbers import assume_nonnegative, is_positive, select, sqrt
from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.options import INNOVATION, Influence


def weigh(
    t: Trace, model: Model, influence: Influence, name: str, nu: Value, r: Value, used: Value | None
) -> tuple[Value, Value]:
    """sigma psi(e) and the weight g = psi'(e) of an innovation nu, e = nu / sigma, sigma = sqrt(r).

    r = 0: the innovation as it is. Flags GLITCH_LARGE where g = 0, GLITCH_SMALL where 0 < g < 1; used: whether
    the component counts at all.
    """
    sigma = sqrt(r)
    valid = None if is_positive(r) else r > 0
    if used is not None:
        valid = used if valid is None else valid & used
    if influence.kind == "custom":
        return _custom(t, model, influence, name, nu, sigma, valid)

    def beyond(limit: Fraction) -> Value:
        exceeds: Value = size > sigma * limit
        return exceeds if valid is None else exceeds & valid

    size = t.name(t.function("abs", nu), f"size_{name}")
    if influence.kind == "huber":
        assert influence.k is not None
        cut = t.name(beyond(influence.k), f"large_{name}")
        t.flag(cut, "GLITCH_LARGE")
        edge = sigma * influence.k
        value, g = select(cut, select(nu > 0, edge, -edge), nu), select(cut, t.zero, t.one)
    else:
        glitch = t.name(beyond(Fraction(3)), f"glitch_{name}")
        large = t.name(beyond(Fraction(6)), f"large_{name}")
        t.flag(glitch & ~large, "GLITCH_SMALL")
        t.flag(large, "GLITCH_LARGE")
        third = t.value(Fraction(1, 3))
        value = select(glitch, select(large, select(nu > 0, sigma, -sigma), third * nu), nu)
        g = select(glitch, select(large, t.zero, third), t.one)
    return t.name(value, f"weighed_{name}"), t.name(g, f"weight_{name}")


def _custom(
    t: Trace, model: Model, influence: Influence, name: str, nu: Value, sigma: Value, valid: Value | None
) -> tuple[Value, Value]:
    e = nu / sigma if valid is None else select(valid, nu / sigma, 0)
    values = {model.symbols[name]: t.field(f"kf.parameters.{name}") for name, _ in model.parameters}
    lowering = Lowering(t, {**values, INNOVATION: t.name(e, f"e_{name}")})
    psi, slope = lowering(influence.psi), lowering(influence.slope)
    g = assume_nonnegative(t.name(t.function("max", slope, t.zero), f"slope_{name}"))
    value = sigma * psi
    if valid is not None:
        value, g = select(valid, value, nu), select(valid, g, t.one)
    t.name(value, f"weighed_{name}")
    t.flag((g > 0) & (g < 1), "GLITCH_SMALL")
    t.flag(g <= 0, "GLITCH_LARGE")
    return value, g
