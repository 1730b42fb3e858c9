"""From one state to the next: a discrete step, or an integrator, on numbers and on rotations alike."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.attitude import Attitude, dual_cross, of_numbers
from kfgen.filters.algebra.dual import Dual, Evaluator, attitudes
from kfgen.filters.algebra.span import Limits, span
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.spec import constants

FARTHEST = Fraction(6)
"""Squared rotations of a step up to which polynomials are shorter than sine and cosine."""
SURE = 10
"""Initial standard deviations within which a state without dynamics of its own and without a range stays."""


def compensated(model: Model) -> tuple[int, ...]:
    """The states whose rounding is carried on: see `compensation`."""
    return tuple(i for i, name in enumerate(model.states) if name in model.spec.code.compensated)


def stepped(t: Trace, model: Model, evaluator: Evaluator) -> list[Dual]:
    """x after a discrete step."""
    turning = {r.first + k for r in model.rotations for k in range(4)}
    after = [Dual(t.zero) if i in turning else evaluator(e) for i, e in enumerate(model.f)]
    for r, turn in zip(model.rotations, model.turns, strict=True):
        if turn is None:
            new = of_numbers(t, r.name, r.geometry, [evaluator(e) for e in model.f[r.first : r.first + 4]])
        else:
            phi = [evaluator(e) for e in turn]
            new = evaluator.attitudes[r.name].by(phi, squared_bound(t, model, phi), r.parts)
        after[r.first : r.first + 4] = new.numbers()
    return after


def errors_of(model: Model, x: list[Dual]) -> list[Dual]:
    """The errors of a state, with their derivatives."""
    out = []
    for i, j in enumerate(model.space.errors_of):
        if j is not None:
            out.append(x[i])
        elif x[i].attitude is not None and any(r.first == i for r in model.rotations):
            zero = x[i].value.trace.zero
            out += [Dual(zero, gradient) for gradient in x[i].attitude.error]
    return out


def rates_of_errors(model: Model, evaluator: Evaluator) -> list[Dual]:
    """The rates of all errors by the noises: f, and the rates of rotations as their error has them."""
    out: list[Dual] = []
    for i, j in enumerate(model.space.errors_of):
        if j is not None:
            out.append(evaluator(model.f[i]))
    for r, turn in zip(model.rotations, model.turns, strict=True):
        assert turn is not None
        rates = [evaluator(e) for e in turn]
        if not r.geometry.body:
            rates = [evaluator.attitudes[r.name].turned(rates, i, False) for i in range(3)]
        out[r.first_error : r.first_error] = rates
    return out


def squared_bound(t: Trace, model: Model, phi: list[Dual]) -> Fraction | None:
    """Of |phi|^2 for inputs, parameters and states within their declared ranges, if all that it needs is declared."""
    total = Fraction(0)
    limits = declared_limits(model)
    for d in phi:
        found = span(d.value.node, limits)
        if found is None:
            return None
        total += max(found[0] ** 2, found[1] ** 2)
    return total * Fraction(5, 4) if total <= FARTHEST else None


def declared_limits(model: Model) -> Limits:
    """What the spec declares of inputs, parameters, the step and states."""
    spec = model.spec
    found: dict[tuple[str, int | None], tuple[Fraction, Fraction]] = {}

    def declare(path: str, index: int | None, low: Fraction | float, high: Fraction | float) -> None:
        found[path, index] = (Fraction(low), Fraction(high))

    for path, limits in [*((f"u.{i.name}", i.range) for i in spec.inputs),
                         *((f"kf.parameters.{p.name}", p.range) for p in spec.parameters)]:  # fmt: skip
        if limits is not None:
            low, high = (float(constants.value(limit.tree, spec)) for limit in limits)
            declare(path, None, low, high)
    low_dt, high_dt = model.dt_limits
    if high_dt is not None:
        declare("dt", None, 0 if low_dt is None else low_dt, high_dt)
    still = [f == (0 if spec.dynamics.form != "discrete" else model.symbols[name])
             for name, f in zip(model.states, model.f, strict=True)]  # fmt: skip
    for i, (state, error) in enumerate(zip(spec.states, model.space.errors_of, strict=True)):
        limits = state.range or state.bounds
        if limits is not None:
            low, high = (float(constants.value(limit.tree, spec)) for limit in limits)
            declare("kf.x", i, low, high)
        elif error is not None and still[i]:
            reach = SURE * float(model.P0[error][error]) ** 0.5
            declare("kf.x", i, float(model.x0[i]) - reach, float(model.x0[i]) + reach)
    return found


def integrate(
    t: Trace, model: Model, duals: dict[str, Dual], dt: Value, held: list[str], derivatives: int
) -> tuple[list[Dual], list[Dual]]:
    """euler, midpoint or rk4 with substeps; t, dt, inputs and noises are held over the step. Where x is then, and by
    what its numbers have moved. Rotations: x exp(h k) with h k in the body's frame, in rk4 the stages of Munthe-Kaas
    (1998).

    Derivatives are carried through the stages, so F and G are those of the integrator itself.
    """
    dynamics = model.spec.dynamics
    h = dt * Fraction(1, dynamics.substeps)
    constant = {name: d for name, d in duals.items() if name not in model.states}
    for noise in model.noises:
        if noise.name not in held:
            constant[noise.name] = Dual(t.zero)
    moving = [i for i, e in enumerate(model.f) if e != 0]

    def rate(x: list[Dual]) -> tuple[list[Dual], list[list[Dual]]]:
        evaluator = Evaluator(t, model, {**constant, **dict(zip(model.states, x, strict=True))}, derivatives)
        turns = [[evaluator(e) for e in turn] for turn in model.turns if turn is not None]
        return [evaluator(e) for e in model.f], turns

    def shifted(x: list[Dual], k: list[Dual], length: Value) -> list[Dual]:
        return [a + b.scaled(length) if i in moving else a for i, (a, b) in enumerate(zip(x, k, strict=True))]

    def turned(x: list[Dual], start: list[Dual], by: list[list[Dual]], last: bool = False) -> list[Dual]:
        """x with the rotations of `start` turned."""
        for r, phi in zip(model.rotations, by, strict=True):
            attitude: Attitude = start[r.first].attitude
            new = attitude.by(phi, squared_bound(t, model, phi), r.parts if last else ())
            x[r.first : r.first + 4] = new.numbers()
        return x

    x = [duals[name] for name in model.states]
    given = attitudes(t, model, duals)
    for r in model.rotations:
        x[r.first : r.first + 4] = given[r.name].numbers()
    whole = [Dual(t.zero) for _ in x]
    for step in range(dynamics.substeps):
        k1, w1 = rate(x)
        if dynamics.integrator == "euler":
            k, w, part = k1, w1, h
        elif dynamics.integrator == "midpoint":
            half = h * Fraction(1, 2)
            k, w = rate(turned(shifted(x, k1, half), x, _scaled(w1, half)))
            part = h
        else:
            half, stages, u = h * Fraction(1, 2), [(k1, w1)], w1
            for length in (half, half, h):
                by = _scaled(u, length)
                rates, turning = rate(turned(shifted(x, stages[-1][0], length), x, by))
                u = [_within(a, b) for a, b in zip(by, turning, strict=True)]
                stages.append((rates, u))
            k = [a + (b + c).scaled(2) + d for a, b, c, d in zip(*(s[0] for s in stages), strict=True)]
            w = [[a + (b + c).scaled(2) + d for a, b, c, d in zip(*turn, strict=True)]
                 for turn in zip(*(s[1] for s in stages), strict=True)]  # fmt: skip
            part = h * Fraction(1, 6)
        x = turned(shifted(x, k, part), x, _scaled(w, part), step == dynamics.substeps - 1)
        if compensated(model):
            whole = shifted(whole, k, part)
    return x, whole


def _scaled(turns: list[list[Dual]], length: Value) -> list[list[Dual]]:
    return [[w.scaled(length) for w in turn] for turn in turns]


def _within(u: list[Dual], w: list[Dual]) -> list[Dual]:
    """The rate of u where q exp(u) turns with w: Jr(u)^-1 w to the third order."""
    once = dual_cross(u, w)
    twice = dual_cross(u, once)
    return [a + b.scaled(Fraction(1, 2)) + c.scaled(Fraction(1, 12)) for a, b, c in zip(w, once, twice, strict=True)]
