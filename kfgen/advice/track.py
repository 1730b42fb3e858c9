"""A short track of a spec's own model, and its derivatives along it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError, Place
from kfgen.reference.model import Context, Model
from kfgen.reference.process import Process
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.reference.status import StepError
from kfgen.simulate import simulate
from kfgen.spec.modes import mode_specs
from kfgen.spec.parts import nodes
from kfgen.spec.types import Dynamics, Spec

Array = NDArray[np.float64]

ROWS = 24  # at least; three times as many as there are states where that is more
MOST = 60
WORK = 100_000  # operations, with gradients: about a second


@dataclass(frozen=True)
class Track:
    """A spec (of a mode) with an error of n along k rows.

    names, places: of the coordinates of the error; real (n): which are states, and not of a rotation. size (k, n): how
    large the states are. step (k, n): what f moves them by, without noise. F (k, n, n), Q (n, n): of the step from each
    row, its noise at the first. H, R: sensor -> (k, m, n), (m, m) likewise.
    """

    spec: Spec
    model: Model
    names: tuple[str, ...]
    places: tuple[Place, ...]
    real: NDArray[np.bool_]
    size: Array
    step: Array
    F: Array
    Q: Array
    H: dict[str, Array]
    R: dict[str, Array]


def follow(spec: Spec) -> list[Track]:
    """The tracks of a spec, or of its modes. KfgenError where the model does not get through one."""
    spec = _quick(spec)
    rows = min(MOST, max(ROWS, 3 * len(spec.states)))
    if rows * sum(map(_size, mode_specs(spec))) > WORK:
        raise KfgenError(f"{spec.name}: a track of the model takes too long for advice")
    log = simulate(spec, rows, seed=1)
    x = np.column_stack([log.columns[f"true.{state.name}"] for state in spec.states])
    u = np.column_stack([log.columns[each.name] for each in spec.inputs] or [np.zeros((rows, 0))])
    t = log.columns["t"]
    given = {s.name: np.array([log.columns[f"{s.name}.{i.name}"] for i in s.inputs]).T for s in spec.measurements}
    try:
        with np.errstate(all="ignore"):
            return [_along(mode, x, u, t, given) for mode in mode_specs(spec)]
    except StepError:
        raise KfgenError(f"{spec.name}: the model cannot be linearised along a track of its own") from None


def _quick(spec: Spec) -> Spec:
    """With rk4 for `exact`, near enough for advice: the reference's matrix exponential takes long to load."""

    def quick(dynamics: Dynamics) -> Dynamics:
        return replace(dynamics, integrator="rk4") if dynamics.integrator == "exact" else dynamics

    imm = spec.imm
    if imm is not None:
        imm = replace(imm, modes=tuple(replace(mode, dynamics=quick(mode.dynamics)) for mode in imm.modes))
    return replace(spec, dynamics=quick(spec.dynamics), imm=imm)


def _size(spec: Spec) -> int:
    """Operations of a step and of all measurements, about."""
    dynamics = spec.dynamics
    stages = {"euler": 1, "midpoint": 2}.get(dynamics.integrator, 4) * dynamics.substeps
    return nodes((dynamics, spec.let)) * (stages if dynamics.form == "continuous" else 1) + nodes(spec.measurements)


def _along(spec: Spec, x: Array, u: Array, t: Array, given: dict[str, Array]) -> Track:
    """given: the own inputs of each sensor that has some (k, inputs)."""
    model = Model(spec)
    process = Process(model)
    dt = 1.0 if spec.dt is None else model.number(spec.dt.nominal)
    space, rows, n = model.space, len(x), model.n
    F, step = np.empty((rows, n, n)), np.empty((rows, n))
    sensors = {sensor.name: SensorModel(model, sensor) for sensor in spec.measurements}
    H = {name: np.empty((rows, sensor.space.k, n)) for name, sensor in sensors.items()}
    R: dict[str, Array] = {}
    Q = np.zeros((n, n))
    for k in range(rows):
        context = Context(model.values, u[k], float(t[k]), dt)
        after = process.linearise(x[k], context)
        F[k], step[k] = after.F, space.difference(after.x, x[k])
        for name, sensor in sensors.items():
            used = tuple(range(sensor.m))
            own = replace(context, own=given[name][k]) if sensor.own else context
            found = sensor.linearise(x[k], Reading(sensor, np.zeros(sensor.m), used, own))
            H[name][k] = found.H
            R.setdefault(name, found.R)
        if k == 0:
            Q = after.Q
    for i, period in model.turns.items():
        step[:, i] -= period * np.round(step[:, i] / period)
    if not (np.isfinite(F).all() and all(np.isfinite(each).all() for each in H.values())):
        raise KfgenError(f"{spec.name}: the model has no finite derivatives along a track of its own")
    places = {state.name: state.place for state in spec.states}
    places |= {name: rotation.place for rotation in spec.rotations for name in rotation.errors}
    size = np.array([space.size(each) for each in x])
    known = tuple(places[name] for name in model.errors)
    return Track(spec, model, model.errors, known, space.real, size, step, F, Q, H, R)
