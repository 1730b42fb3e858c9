"""The time step of a model, traced: f, its Jacobians, the process noise; discrete, or by an integrator."""

from __future__ import annotations

from dataclasses import dataclass, field

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.dual import Dual, Evaluator, seeds, state_seeds
from kfgen.filters.algebra.exact import discretise
from kfgen.filters.algebra.factors import udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import assume_positive, is_zero, require_nonnegative
from kfgen.filters.steps.isotropic import separated, turned_back
from kfgen.filters.steps.motion import compensated, errors_of, integrate, rates_of_errors, stepped
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.spec import constants

NEGATIVE = "a noise variance is negative"


@dataclass(frozen=True)
class Step:
    """The step's length; `raw` is what the caller gave."""

    dt: Value | None
    raw: Value | None = None


@dataclass(frozen=True)
class Prior:
    """What f may use, at the start of the step."""

    x: list[Value]
    duals: dict[str, Dual]


@dataclass(frozen=True)
class Advance:
    """x (of all states), F (n, n), Q (n, n) and the noise columns (w, d) of their n errors: P <- F P F^T + Q + sum of
    d w w^T. Spec's order.

    errors: of x, with their derivatives. after: x with its derivatives. added: what of Q comes from noise densities.
    steps: by what x moves, of those states of which that is asked for.
    """

    x: list[Value]
    F: Rows
    Q: Rows
    noise: list[tuple[Vector, Value]]
    after: list[Dual]
    errors: list[Dual]
    added: Rows | None = None
    steps: dict[int, Value] = field(default_factory=dict)


def step_length(t: Trace, model: Model) -> Step:
    """dt: compiled in, or the argument, tested and clamped."""
    if model.dt is not None:
        return Step(t.value(model.dt))
    if model.spec.dt is None:
        return Step(None)
    low, high = model.dt_limits
    raw = t.field("dt")
    t.guard(~t.finite(raw), "NOT_FINITE")
    step = raw
    if low is None:
        t.guard(raw <= 0, "NOT_POSITIVE")
    else:
        t.flag(raw < low, "DT_CLAMPED")
        step = t.select(raw < low, t.value(low), step)
    if high is not None:
        t.flag(raw > high, "DT_CLAMPED")
        step = t.select(raw > high, t.value(high), step)
    if step is not raw:
        t.name(step, "step")
    if low is None or low > 0:
        assume_positive(step)
    return Step(step, raw)


def parameters_and_inputs(
    t: Trace, model: Model, inputs: bool = True, sensor: SensorModel | None = None
) -> dict[str, Dual]:
    """What a caller sets. sensor: the one whose own inputs come too."""
    out = {name: Dual(t.field(f"kf.parameters.{name}")) for name, _ in model.parameters}
    if inputs:
        out.update({name: Dual(t.field(f"u.{name}")) for name in model.inputs})
    if sensor is not None:
        out.update({name: Dual(t.field(f"z.{name}")) for name in sensor.inputs})
    return out


def declared_signs(model: Model, sensor: SensorModel | None = None) -> dict[str, int]:
    """The signs of inputs and parameters whose declared range excludes 0, by their paths; those of a sensor's too."""
    found: dict[str, int] = {}
    spec = model.spec
    given = [(f"u.{i.name}", i.range) for i in spec.inputs]
    given += [(f"kf.parameters.{p.name}", p.range) for p in spec.parameters]
    given += [] if sensor is None else [(f"z.{i.name}", i.range) for i in sensor.spec.inputs]
    for path, limits in given:
        if limits is not None:
            low, high = (float(constants.value(limit.tree, spec)) for limit in limits)
            if low > 0 or high < 0:
                found[path] = 1 if low > 0 else -1
    return found


def time_now(t: Trace, model: Model) -> Dual:
    """t, seconds since init: a step count where dt is fixed, a compensated sum where it is not."""
    if model.dt is not None or model.spec.dt is None:
        count = t.wrapped(t.pool.make("real", (t.pool.make("field", (), "kf.steps", "int"),)))
        return Dual(count * (model.dt if model.dt is not None else 1))
    return Dual(t.field("kf.t"))


def given(t: Trace, model: Model, step: Step) -> Prior:
    """Values and seeds of all that f may use; noises are at their mean, 0."""
    x = [t.element("kf.x", i) for i in range(len(model.states))]
    duals = state_seeds(t, model, x)
    used = model.uses(*model.dynamics_expressions())
    for name, value in zip(model.states, x, strict=True):
        if name in used:
            t.name(value, name)
    duals.update(seeds(t, {w.name: t.zero for w in model.noises}))
    duals.update(parameters_and_inputs(t, model))
    if model.uses_time():
        duals["t"] = time_now(t, model)
    if step.dt is not None:
        duals["dt"] = Dual(step.dt)
    return Prior(x, duals)


def advance(
    t: Trace,
    model: Model,
    prior: Prior,
    step: Step,
    additive: Rows | None = None,
    derivatives: int = 1,
    carried: tuple[str, ...] = (),
) -> Advance:
    """One step of the model from the prior. additive: what stands for the Q of the spec (n, n).

    derivatives: 2 has `after` carry second derivatives too. carried: noise inputs that are accounted for otherwise.
    """
    n = len(model.errors)
    at_prior = Evaluator(t, model, prior.duals, derivatives)
    Q = [[at_prior.value(e) for e in row] for row in model.Q] if additive is None else additive
    added: Rows | None = None
    held = [w.name for w in model.noises if not w.density]
    dense = [w.name for w in model.noises if w.density]
    extra: list[tuple[Vector, Value]] = []
    Qw = [[at_prior.value(e) for e in row] for row in model.noise_covariance]
    if model.spec.dynamics.form == "discrete":
        after = stepped(t, model, at_prior)
        steps = {i: at_prior.value(model.f[i] - model.symbols[model.states[i]]) for i in compensated(model)}
    else:
        assert step.dt is not None
        if model.spec.dynamics.integrator == "exact":
            linear = discretise(model)
            after = _with_attitudes(model, linear.advance(t, at_prior, prior.duals, step.dt), prior.duals)
            steps = {i: linear.step(i, at_prior, prior.duals) for i in compensated(model)}
            index = [i for i, w in enumerate(model.noises) if w.density]
            added, extra = linear.noise(t, at_prior, [[Qw[i][j] for j in index] for i in index], step.dt)
            own = model.space.numbers_of  # a rotation stands still
            added = [[t.zero if i is None or j is None else added[i][j] for j in own] for i in own]
            extra = [([t.zero if i is None else w[i] for i in own], d) for w, d in extra]
            Q = [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(Q, added, strict=True)]
        else:
            after, moved_by = integrate(t, model, prior.duals, step.dt, held, derivatives)
            steps = {i: moved_by[i].value for i in compensated(model)}
            extra = _columns(t, model, rates_of_errors(model, at_prior), dense, Qw, step.dt)
    errors = errors_of(model, after)
    F = [[d.gradient.get(name, t.zero) for name in model.errors] for d in errors]
    noise = _columns(t, model, errors, [w for w in held if w not in carried], Qw, None) + extra
    assert len(F) == n
    if model.rotations:
        Q, noise = separated(Q, turned_back(t, noise, at_prior.attitudes.values()))
    return Advance([d.value for d in after], F, Q, noise, after, errors, added, steps)


def moved(t: Trace, model: Model, duals: dict[str, Dual], dt: Value | None) -> list[Value]:
    """x after a step from given values of all that f uses, noise inputs included."""
    if model.spec.dynamics.form == "discrete":
        return [d.value for d in stepped(t, model, Evaluator(t, model, duals))]
    assert dt is not None
    if model.spec.dynamics.integrator == "exact":
        after = _with_attitudes(model, discretise(model).advance(t, Evaluator(t, model, duals), duals, dt), duals)
    else:
        after, _ = integrate(t, model, duals, dt, [w.name for w in model.noises if not w.density], 1)
    return [d.value for d in after]


def _with_attitudes(model: Model, after: list[Dual], before: dict[str, Dual]) -> list[Dual]:
    """x after an exact step, in which no rotation turns."""
    for r in model.rotations:
        after[r.first : r.first + 4] = [before[part] for part in r.parts]
    return after


def _columns(t: Trace, model: Model, after: list[Dual], names: list[str], Qw: Rows, dt: Value | None
             ) -> list[tuple[Vector, Value]]:  # fmt: skip
    """G Qw G^T as columns, Qw factored where it is not diagonal; times dt for a density."""
    index = [i for i, w in enumerate(model.noises) if w.name in names]
    if not index:
        return []
    part = [[Qw[i][j] for j in index] for i in index]
    q = len(index)
    G = [[d.gradient.get(model.noises[i].name, t.zero) for i in index] for d in after]
    if all(is_zero(part[i][j]) for i in range(q) for j in range(q) if i != j):
        weights = [part[i][i] for i in range(q)]
    else:
        U, weights = udu(part)
        for d in weights:
            require_nonnegative(d, NEGATIVE)
        G = [
            [linalg.dot([row[k] for k in range(j + 1)], [*[U[k][j] for k in range(j)], 1]) for j in range(q)]
            for row in G
        ]
        G = [[t.value(g) for g in row] for row in G]
    columns = []
    for j, weight in enumerate(weights):
        column = [row[j] for row in G]
        weight = t.value(weight)
        if not is_zero(weight) and not all(is_zero(g) for g in column):
            require_nonnegative(weight, NEGATIVE)
            columns.append((column, weight if dt is None else weight * dt))
    return columns


def store_time(t: Trace, model: Model, step: Step) -> None:
    """Advance t by the step: Kahan's compensated sum where dt is given at run time."""
    if not model.uses_time():
        return
    if model.dt is not None or model.spec.dt is None:
        count = t.pool.make("field", (), "kf.steps", "int")
        t.store("kf.steps", None, t.wrapped(t.pool.add(count, t.pool.integer(1))))
        return
    assert step.dt is not None
    before = t.field("kf.t")
    term = t.name(step.dt - t.field("kf.t_lost"), "t_term")
    after = t.name(before + term, "t_next")
    t.store("kf.t_lost", None, (after - before) - term)
    t.store("kf.t", None, after)
