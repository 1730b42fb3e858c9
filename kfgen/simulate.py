"""Logs drawn from a spec's own model.

The truth starts at a draw from N(x0, P0) and is stepped by f with drawn noise; sensors see h of it with drawn
noise. The model is evaluated by the reference, never by generated code.

* Noise inputs are drawn with their covariance and go through f (and h). The additive Q, and densities, are
  drawn with their covariance along the track. R likewise. Semidefinite covariances are fine.
* Inputs, those of sensors too, are smooth: three sines with periods of 25 to 250 steps, within a quarter of the
  half-width of the input's range around its middle; without a range around 0 with an amplitude of at most 1.
* Fixed dt: row k is the time (k + 1) dt, after that row's predict. Run-time dt: the first row is t = 0,
  without a step; the steps are the nominal one with up to 10 % of jitter, within [min, max].
* An imm switches modes by its transition matrix, row by row, from a mode drawn with mu0.
* The truth of a state with bounds is clipped to them; angles and measured angles are wrapped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.geometry import part_of
from kfgen.logs import Log
from kfgen.reference.dual import value_of
from kfgen.reference.linalg import udu
from kfgen.reference.model import Context, Model, fixed_step
from kfgen.reference.process import Process
from kfgen.reference.sensor import Reading, SensorModel
from kfgen.reference.status import StepError
from kfgen.spec.modes import mode_specs
from kfgen.spec.sensors import columns_of
from kfgen.spec.tree import Expression, Number
from kfgen.spec.types import Input, Matrix, Noise, Sensor, Spec

Array = NDArray[np.float64]


class Draws(Protocol):
    """Where random numbers come from: these methods of numpy's Generator."""

    def random(self) -> float: ...

    def uniform(self, low: float, high: float, size: int) -> Array: ...

    def standard_normal(self, size: int) -> Array: ...

    def choice(self, a: int, *, p: Array) -> int: ...


STEPS = 500
JITTER = 0.1


def simulate(
    spec: Spec,
    steps: int = STEPS,
    seed: int = 0,
    every: Mapping[str, int] | None = None,
    gaps: float = 0.0,
    draws: Draws | None = None,
) -> Log:
    """A log of `steps` rows, the truth in columns `true.<state>`; the same for the same seed.

    every: sensor -> it measures in each so many-th row only (default 1). gaps: the share of readings that are
    lost at random. draws: random numbers in place of numpy's (`seed` is not used then). Raises KfgenError where the
    model leaves the finite numbers, or a covariance is none.
    """
    if steps < 1:
        raise KfgenError(f"a log needs at least one step, not {steps}")
    unknown = sorted(set(every or ()) - {sensor.name for sensor in spec.measurements})
    if unknown:
        known = ", ".join(sensor.name for sensor in spec.measurements)
        raise KfgenError(f"unknown sensor `{unknown[0]}` (known: {known})")
    random = cast(Draws, np.random.default_rng(seed)) if draws is None else draws
    try:
        with np.errstate(all="ignore"):
            return _simulate(spec, steps, random, every or {}, gaps)
    except StepError as error:
        reason = error.status.name or "an error"
        raise KfgenError(f"{spec.name}: the model met {reason} on its own track; try another --seed") from None


def _simulate(spec: Spec, steps: int, random: Draws, every: Mapping[str, int], gaps: float) -> Log:
    worlds = [_World(each) for each in mode_specs(spec)]
    model = worlds[0].model
    t, dt = _times(spec, model, steps, random)
    u = _inputs(spec.inputs, model, steps, random)
    modes = _mode_track(spec, model, dt, random)
    x = worlds[modes[0]].initial(random)
    run_time = spec.dt is not None and spec.dt.run_time
    truth = np.empty((steps, model.n))
    given = {sensor.name: _inputs(sensor.inputs, model, steps, random) for sensor in spec.measurements}
    readings = {sensor.name: np.full((steps, len(sensor.fields)), np.nan) for sensor in spec.measurements}
    now = 0.0
    for k in range(steps):
        world = worlds[modes[k]]
        if k > 0 or not run_time:
            x = world.step(x, Context(model.values, u[k], now, float(dt[k])), random)
            now = float(t[k])
        truth[k] = x
        for name, column in readings.items():
            context = Context(model.values, u[k], now, 0.0, given[name][k])
            z = world.measure(name, x, context, random)
            lost = gaps > 0 and random.random() < gaps
            if k % every.get(name, 1) == 0 and not lost:
                column[k] = np.concatenate([z, given[name][k]])
    columns = {"t": t, **{each.name: u[:, i] for i, each in enumerate(spec.inputs)}}
    for sensor in spec.measurements:
        columns |= dict(zip(columns_of(sensor), readings[sensor.name].T, strict=True))
    columns |= {f"true.{name}": truth[:, i] for i, name in enumerate(model.states)}
    return Log(columns, steps, "<simulated>")


@dataclass(frozen=True)
class _Meter:
    """A sensor as it measures: its model, its additive noise alone, its noise inputs."""

    spec: Sensor
    model: SensorModel
    additive: SensorModel


class _World:
    """The model of a spec (or of a mode) that draws its noises."""

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.model = Model(spec)
        self._process = Process(self.model)
        held = [not noise.density for noise in spec.noise]
        self._held = np.flatnonzero(held)
        self._noise = self.model.noise_covariance(spec.noise, spec.noise_covariance)
        # with the noises per step silenced, what linearise gives for Q is all that acts additively
        silent, covariance = _silenced(spec.noise, spec.noise_covariance, held)
        self._additive = Process(Model(replace(spec, noise=silent, noise_covariance=covariance)))
        self._meters = {sensor.name: self._meter(sensor) for sensor in spec.measurements}

    def _meter(self, sensor: Sensor) -> _Meter:
        silent, covariance = _silenced(sensor.noise, sensor.noise_covariance, [True] * len(sensor.noise))
        quiet = replace(sensor, noise=silent, noise_covariance=covariance)
        return _Meter(sensor, SensorModel(self.model, sensor), SensorModel(self.model, quiet))

    def initial(self, random: Draws) -> Array:
        """A draw of the first state [n]."""
        model = self.model
        return self._placed(model.x0 + _draw(model.P0, random))

    def step(self, x: Array, context: Context, random: Draws) -> Array:
        """The state [n] after a step with drawn noise."""
        Qw = self._noise(self.model.environment(context, x))[np.ix_(self._held, self._held)]
        after = self._process.advance(x, _draw(Qw, random), context)
        after = after + _draw(self._additive.linearise(x, context).Q, random)
        if not np.all(np.isfinite(after)):
            raise KfgenError(f"{self.spec.name}: the simulated state left the finite numbers; try another --seed")
        return self._placed(after)

    def measure(self, name: str, x: Array, context: Context, random: Draws) -> Array:
        """A drawn reading [m] of a sensor at the state x [n]."""
        meter = self._meters[name]
        used = tuple(range(meter.model.m))
        noise = self.model.noise_covariance(meter.spec.noise, meter.spec.noise_covariance)
        e = _draw(noise(self.model.environment(context, x, own=meter.model.own)), random)
        z = np.array([value_of(h) for h in meter.model.predict(list(x), list(e), context, used)])
        R = meter.additive.linearise(x, Reading(meter.additive, z, used, context)).R
        z = z + _draw(R, random)
        for i, component in enumerate(meter.spec.components):
            period = None if component.period is None else self.model.number(component.period)
            z[i] = part_of(period).placed(float(z[i]))
        return z

    def _placed(self, x: Array) -> Array:
        x = self.model.clip(x)
        return np.array([part_of(self.model.periods.get(i)).placed(float(v)) for i, v in enumerate(x)])


def _draw(P: Array, random: Draws) -> Array:
    """A draw from N(0, P); as many random numbers are used whatever P is, so that tracks stay comparable."""
    n = len(P)
    numbers = random.standard_normal(n)
    U, D = udu(P)
    drawn: Array = U @ (np.sqrt(np.maximum(D, 0.0)) * numbers)
    return drawn


def _silenced(
    noise: tuple[Noise, ...], covariance: Matrix | None, which: list[bool]
) -> tuple[tuple[Noise, ...], Matrix | None]:
    """Noise inputs with those in `which` at variance 0."""
    if covariance is None:
        silent = (replace(n, variance=_zero(n)) if off else n for n, off in zip(noise, which, strict=True))
        return tuple(silent), None
    rows = tuple(
        tuple(
            replace(entry, tree=Number(Fraction(0))) if which[i] or which[j] else entry for j, entry in enumerate(row)
        )
        for i, row in enumerate(covariance)
    )
    return noise, rows


def _zero(noise: Noise) -> Expression:
    return Expression(Number(Fraction(0)), "0", noise.place)


def _times(spec: Spec, model: Model, steps: int, random: Draws) -> tuple[Array, Array]:
    """t [steps] of the rows and the step dt [steps] that leads to each."""
    if spec.dt is None:
        return np.arange(1.0, steps + 1), np.ones(steps)
    fixed = fixed_step(spec)
    if fixed is not None:
        t = np.array([float((k + 1) * fixed) for k in range(steps)])
        return t, np.full(steps, float(fixed))
    nominal = model.number(spec.dt.nominal)
    drawn = nominal * (1 + JITTER * random.uniform(-1.0, 1.0, steps))
    low = -math.inf if spec.dt.minimum is None else model.number(spec.dt.minimum)
    high = math.inf if spec.dt.maximum is None else model.number(spec.dt.maximum)
    # a log's times are short decimals; what counts is the difference of the times as written
    digits = max(0, 4 - math.floor(math.log10(nominal)))
    t = np.round(np.concatenate([[0.0], np.cumsum(np.clip(drawn, low, high)[1:])]), digits)
    return t, np.diff(t, prepend=0.0)


def _inputs(inputs: tuple[Input, ...], model: Model, steps: int, random: Draws) -> Array:
    """Smooth inputs [steps, inputs]."""
    u = np.empty((steps, len(inputs)))
    k = np.arange(steps)
    for i, each in enumerate(inputs):
        middle, amplitude = 0.0, 1.0
        if each.range is not None:
            low, high = (model.number(limit) for limit in each.range)
            middle, amplitude = (low + high) / 2, (high - low) / 8
        periods = 25 * 10 ** random.uniform(0.0, 1.0, 3)
        phases = random.uniform(0.0, 2 * math.pi, 3)
        waves = np.sin(2 * math.pi * k[:, None] / periods + phases)
        u[:, i] = middle + amplitude * waves.mean(axis=1)
    return u


def _mode_track(spec: Spec, model: Model, dt: Array, random: Draws) -> list[int]:
    """The mode in each row. dt (rows,): the step that leads to it."""
    if spec.imm is None:
        return [0] * len(dt)
    mu = np.array([model.number(entry) for entry in spec.imm.mu0])
    track = [int(random.choice(len(mu), p=mu / mu.sum()))]
    for step in dt[1:]:
        row = np.array([model.number(entry, float(step)) for entry in spec.imm.transition[track[-1]]])
        row = np.maximum(row, 0.0)
        track.append(int(random.choice(len(mu), p=row / row.sum())))
    return track
