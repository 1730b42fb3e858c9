"""Sigma points in the emitted code: the model as private functions, and loops over an array of points.

An array `cloud` holds, point after point, what each adds to x (n values) and to the carried noise inputs (q).
A loop runs the model on every point; its deviations overwrite the points.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import sympy

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.linalg import Vector, plus, times
from kfgen.filters.algebra.numbers import is_zero, select
from kfgen.filters.base import CONST_KF, INPUTS, image_of, sensor_argument
from kfgen.filters.sigma.points import PointSet
from kfgen.filters.sigma.turned import point
from kfgen.filters.steps import process
from kfgen.filters.steps.sensor import predicted_attitude
from kfgen.geometry.part import Part
from kfgen.geometry.space import Space
from kfgen.ir.nodes import Node
from kfgen.ir.program import Argument, Call, Function, Statement, roots, walk
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel

_STEP = Argument("step", "{name}_real_t", pointer=False)


@dataclass(frozen=True)
class Private:
    """A private function and what it is given beside its arrays."""

    function: Function
    given: list[str]  # of kf, u, z, step

    def arguments(self, step: Value | None) -> list[str | Value]:
        out: list[str | Value] = []
        for name in self.given:
            if name == "step":
                assert step is not None
                out.append(step)
            else:
                out.append(name)
        return out


def given_for(body: list[Statement], sensor: SensorModel | None = None) -> list[Argument]:
    """What a scheduled body reads of the filter, the inputs, a measurement of the sensor, and the step."""
    read: set[str] = set()
    for statement in walk(body):
        if isinstance(statement, Call):
            read |= {a for a in statement.args if isinstance(a, str)}
        stack = roots(statement)
        while stack:
            node = stack.pop()
            if node.op in ("field", "element"):
                read.add(str(node.data).partition(".")[0])
            stack += node.args
    measured = [] if sensor is None or not sensor.inputs else [sensor_argument(sensor.name)]
    return [a for a in (CONST_KF, INPUTS, *measured, _STEP) if a.name in read]


def _duals(
    t: Trace, model: Model, x: list[Value], noises: dict[str, Value], used: set[str], sensor: SensorModel | None = None
) -> dict[str, Dual]:
    duals = {name: Dual(value) for name, value in zip(model.states, x, strict=True)}
    duals.update({name: Dual(value) for name, value in noises.items()})
    duals.update(process.parameters_and_inputs(t, model, sensor=sensor))
    if "t" in used:
        duals["t"] = process.time_now(t, model)
    if model.dt is not None:
        duals["dt"] = Dual(t.value(model.dt))
    elif model.spec.dt is not None:
        duals["dt"] = Dual(t.field("step"))
    return duals


def _state(t: Trace, model: Model, used: set[str]) -> list[Value]:
    """The point's state within its bounds."""
    x = []
    for i, (name, bounds) in enumerate(zip(model.states, model.bounds, strict=True)):
        value = clipped(t, t.element("x", i), bounds)
        x.append(t.name(value, name) if name in used else value)
    return x


def clipped(t: Trace, value: Value, bounds: tuple[Fraction, Fraction] | None) -> Value:
    if bounds is None:
        return value
    low, high = t.value(bounds[0]), t.value(bounds[1])
    result: Value = select(value < low, low, select(value > high, high, value))
    return result


def dynamics(model: Model, carried: tuple[str, ...], taken: frozenset[str]) -> Private:
    """x <- f(x, u, w) in place, x (n + q) with the carried noises behind the states."""
    t, n = Trace(), len(model.states)
    used = model.uses(*model.f)
    noises = {w.name: t.zero for w in model.noises}
    for k, name in enumerate(carried):
        noises[name] = t.name(t.element("x", n + k), name)
    x = _state(t, model, used)
    duals = _duals(t, model, x, noises, used)
    dt = duals["dt"].value if "dt" in duals else None
    after = process.moved(t, model, duals, dt)
    for i, value in enumerate(after):
        if value.node is not t.element("x", i).node:
            t.store("x", i, value)
    out = Argument("x", "{name}_real_t", pointer=True, constant=False, size=n + len(carried))
    body = schedule(t, taken | {"kf", "u", "step", "x"})
    return private("f", body, [out], "x <- f(x, u, w), in place")


def turning_dynamics(model: Model, images: Space, carried: tuple[str, ...], taken: frozenset[str]) -> Private:
    """e <- f(start [+] e, u, w) [-] centre in place, e (n + q) with the carried noises behind the n errors."""
    t, n = Trace(), len(model.errors)
    used = model.uses(*model.dynamics_expressions())
    noises = {w.name: t.zero for w in model.noises}
    for k, name in enumerate(carried):
        noises[name] = t.name(t.element("e", n + k), name)
    start = [t.element("start", i) for i in range(len(model.states))]
    x = point(model, start, [t.element("e", i) for i in range(n)])
    x = [clipped(t, value, bounds) for value, bounds in zip(x, model.bounds, strict=True)]
    for value, name in zip(x, model.states, strict=True):
        if name in used:
            t.name(value, name)
    duals = _duals(t, model, x, noises, used)
    after = process.moved(t, model, duals, duals["dt"].value if "dt" in duals else None)
    after = [clipped(t, value, bounds) for value, bounds in zip(after, model.bounds, strict=True)]
    centre = [t.element("centre", i) for i in range(len(model.states))]
    for i, value in enumerate(images.local(after, centre)):
        t.store("e", i, t.value(value))
    arrays = [Argument("start", "{name}_real_t", pointer=True, size=len(model.states)),
              Argument("centre", "{name}_real_t", pointer=True, size=len(model.states)),
              Argument("e", "{name}_real_t", pointer=True, constant=False, size=n + len(carried))]  # fmt: skip
    body = schedule(t, taken | {"kf", "u", "step", "e", "start", "centre"})
    return private("f", body, arrays, "e <- f(start [+] e, u, w) [-] centre, in place")


def private(
    name: str, body: list[Statement], arrays: list[Argument], doc: str, sensor: SensorModel | None = None
) -> Private:
    """A private function that is given what its body reads, and arrays."""
    arguments = given_for(body, sensor)
    function = Function(name, [*arguments, *arrays], body, doc, returns="void", private=True)
    return Private(function, [a.name for a in arguments])


def measurement(model: Model, sensor: SensorModel, carried: tuple[str, ...], taken: frozenset[str]) -> Private:
    """z = h(x, e), x (n + q) with the carried noises behind the states."""
    t, n = Trace(), len(model.states)
    used = model.uses(*sensor.h)
    noises = {w.name: t.zero for w in sensor.noises}
    for k, name in enumerate(carried):
        noises[name] = t.name(t.element("x", n + k), name)
    evaluator = Evaluator(t, model, _duals(t, model, _state(t, model, used), noises, used, sensor))
    name = image_of(sensor)
    turning = {r.first + k for r in sensor.rotations for k in range(4)}
    z: list[Dual] = []
    for i, e in enumerate(sensor.h):
        z.append(Dual(evaluator.value(e)))
        if i not in turning:
            t.store(name, i, z[i].value)
    for r in sensor.rotations:
        for k, value in enumerate(predicted_attitude(evaluator, sensor, r, z).q):
            t.store(name, r.first + k, value)
    point = Argument("x", "{name}_real_t", pointer=True, size=n + len(carried))
    out = Argument(name, "{name}_real_t", pointer=True, constant=False, size=len(sensor.h))
    body = schedule(t, taken | {"kf", "u", "x", "z", name})
    return private(f"h_{sensor.name}", body, [point, out], f"what {sensor.name} measures at x", sensor)


def fill(t: Trace, cloud: Array, points: PointSet, columns: list[Vector], step: int = 1) -> None:
    """Write what each point adds to the mean: rows of coefficients times the columns of the root, each (stride,).

    step: of each so many points only the first.
    """
    stride = len(columns[0])
    scaled: dict[tuple[int, Fraction], list[Value]] = {}
    for k, row in list(enumerate(points.rows))[::step]:
        for i in range(stride):
            total: Value | int = 0
            for j, coefficient in enumerate(row):
                if coefficient and not is_zero(columns[j][i]):
                    key = (j, abs(coefficient))
                    if key not in scaled:
                        scaled[key] = [t.value(times(c, abs(coefficient))) for c in columns[j]]
                    term = scaled[key][i]
                    total = plus(total, term if coefficient > 0 else -term)
            cloud[k * stride + i] = t.value(total)


def weights(t: Trace, values: list[Fraction], k: Value, name: str) -> Value:
    """The weight of point k: a constant, or an entry of a table."""
    if len(set(values)) == 1:
        return t.value(values[0])
    return t.constants(tuple(values), k, name)


def residual_uses(model: Model, sensor: SensorModel) -> set[str]:
    """Names that own residuals of the sensor use."""
    return model.uses(*(r for r in sensor.residual if r is not None))


def difference(
    t: Trace, model: Model, sensor: SensorModel, part: Part, i: int, z: Value, base: Value, x: list[Value]
) -> Value:
    """z - base of component i in the geometry of its images, or by its own residual at x."""
    used = residual_uses(model, sensor)
    residual = sensor.residual[i]
    if residual is not None:
        name = sensor.spec.components[i].name
        evaluator = Evaluator(t, model, _duals(t, model, x, {w.name: t.zero for w in sensor.noises}, used, sensor))
        evaluator.bind(sympy.Symbol(f"z_{name}"), z)
        evaluator.bind(sympy.Symbol(f"h_{name}"), base)
        return evaluator.value(residual)
    difference: Value = part.local(z, base)
    return difference


def depends(value: Value, prefixes: tuple[str, ...]) -> bool:
    """Whether a value reads any field or element of such a path."""
    stack, seen = [value.node], set()
    while stack:
        node: Node = stack.pop()
        if node.serial in seen:
            continue
        seen.add(node.serial)
        if node.op in ("element", "field") and str(node.data).startswith(prefixes):
            return True
        stack.extend(node.args)
    return False


def bends(values: list[Value], gradients: list[Value]) -> bool:
    """Whether some function of kf.x is not affine: a derivative depends on it, or something jumps with it."""
    return any(depends(g, ("kf.x",)) for g in gradients) or _jumps(values, _STEPS, ("kf.x",))


def passes(image: Dual, periodic: list[str]) -> bool:
    """Whether a function of kf.x and noises `w.` is linear in the periodic states and jumps nowhere."""
    slopes = [image.gradient[name] for name in periodic if name in image.gradient]
    varying = ("kf.x", "w.")
    return not any(depends(g, varying) for g in slopes) and not _jumps([image.value], (*_STEPS, *_TURNS), varying)


def _jumps(values: list[Value], steps: tuple[str, ...], varying: tuple[str, ...]) -> bool:
    """Whether an operation that steps depends on what varies."""
    stack, seen = [v.node for v in values], set()
    while stack:
        node = stack.pop()
        if node.serial in seen:
            continue
        seen.add(node.serial)
        if node.op in steps and depends(Value(values[0].trace, node), varying):
            return True
        stack.extend(node.args)
    return False


_STEPS = ("lt", "le", "sign", "floor", "ceil", "segment", "wrap")
_TURNS = ("atan", "atan2")


def carried_by(model: Model, duals: list[Dual], names: list[str], covariance: tuple[tuple[object, ...], ...],
               everything: bool) -> tuple[str, ...]:  # fmt: skip
    """The noise inputs that a sigma-point filter carries as dimensions: those by which a derivative contains states
    or noises, and what is correlated with them. duals: traced with noises as fields `w.<name>`."""
    if everything:
        return tuple(names)
    bent = {w for d in duals for w in names if w in d.gradient and depends(d.gradient[w], ("kf.x", "w."))}
    for _ in names:
        for i, w in enumerate(names):
            if w in bent:
                bent |= {v for j, v in enumerate(names) if covariance[i][j] != 0}
    return tuple(w for w in names if w in bent)


def symbolic_noises(t: Trace, names: list[str]) -> dict[str, Dual]:
    """Noise inputs as values of their own, for `carried_by`."""
    return {name: Dual(t.field(f"w.{name}"), {name: t.one}) for name in names}
