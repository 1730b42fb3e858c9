"""Runs all over the declared box, in legs: from its corners, and from points that fill it (a Latin hypercube).

A leg puts truth and estimate to a point of the box, gives the filter other parameters, and drives the inputs and the
step to their ends. What a leg records after the estimate has left the box, or the numbers, does not count.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from kfgen.fixed.ranges.box import Span, clipped
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.memory import Memory, blank
from kfgen.fixed.ranges.runs import Runner
from kfgen.fixed.ranges.weather import Weather

LEGS = 16
ROWS = 30  # of a leg
BEYOND = 1.0  # times the width of its range that an estimate may be outside of it
CORNER = 3 / 8  # the share of legs that begin and drive at the ends of everything
NEAR = 1e-6  # of a range: how near to its end a corner is
VANISHING = 1 / 32  # the same where the lower end of a parameter is 0: what a noise of nothing leaves has no size
HELD = 6  # rows for which an input keeps its value, at least


@dataclass
class Seen:
    """How far the runs have gone in a quantity that has a declared range."""

    low: float = math.inf
    high: float = -math.inf

    def take(self, value: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)


@dataclass
class Leg:
    """Where one begins, what it is given: parameters by name, and what a row draws inputs and dt from.

    places: of each quantity in [0, 1], where it is kept around; 0 and 1 are the ends. fresh: with the covariance of the
    first estimate, and not with what the leg before has left.
    """

    corner: bool
    fresh: bool
    dark: bool  # without readings for some time
    x: list[float]
    parameters: dict[str, float]
    places: dict[str, float] = field(default_factory=dict)


def legs(weather: Weather, random: Random, count: int = LEGS) -> Iterator[Leg]:
    """Legs all over the box of a filter."""
    model, box = weather.model, weather.box
    names = [*(f"x.{s}" for s in model.states), *(f"p.{name}" for name, _ in model.parameters),
             *(f"u.{name}" for name in model.inputs), "dt"]  # fmt: skip
    cube = {name: _shuffled(count, random) for name in names}
    for k in range(count):
        corner = k < CORNER * count
        places = {}
        for name in names:
            place = (cube[name][k] + random.random()) / count
            places[name] = float(place >= 0.5) if corner else place
        x = []
        for i, (state, start) in enumerate(zip(model.states, model.x0, strict=True)):
            span = box.states[i]
            x.append(float(start) if span is None else at(span, places[f"x.{state}"]))
        parameters = {name: float(value) for name, value in model.parameters}
        for name, span in box.parameters.items():
            parameters[name] = at(span, places[f"p.{name}"], VANISHING if span[0] == 0 else NEAR)
        yield Leg(corner, k % 2 == 0, k % 3 == 2, x, parameters, places)


def _shuffled(count: int, random: Random) -> list[int]:
    order = list(range(count))
    for i in reversed(range(1, count)):
        j = int(random.random() * (i + 1))
        order[i], order[j] = order[j], order[i]
    return order


def at(span: Span, place: float, near: float = NEAR) -> float:
    """The point of a span at a place in [0, 1], a little inside. near: how far from its lower end."""
    low, high = span
    place = min(max(place, near), 1.0 - NEAR)
    return low + (high - low) * place


class Drive:
    """Makes the legs of a filter, row by row."""

    def __init__(self, runner: Runner, weather: Weather) -> None:
        self.runner = runner
        self.weather = weather
        self.truth = weather.truth
        self.model = weather.model
        self.seen: dict[str, Seen] = {}
        self.least = [math.inf] * self.truth.n  # of what a step adds to a variance, where it adds anything

    def run(self, seed: int, count: int = LEGS, rows: int = ROWS) -> None:
        """All legs; the ranges of what they meet are the runner's."""
        random = Random(seed)
        memory = blank(self.runner.code)
        self.runner.program.run("init", memory)
        for k, leg in enumerate(legs(self.weather, random, count)):
            memory = self._leg(leg, memory, k, rows, random)

    def _leg(self, leg: Leg, memory: Memory, k: int, rows: int, random: Random) -> Memory:
        runner, truth = self.runner, self.truth
        if leg.fresh:
            memory = blank(runner.code)
            runner.program.run("init", memory)
        self.truth.begin(random)
        for name, value in leg.parameters.items():
            key = f"kf.parameters.{name}"
            memory.numbers[key] = truth.memory.numbers[key] = value
            runner.ranges.see(("number", key), value)
        off = [a - float(b) for a, b in zip(truth.x, self.model.x0, strict=True)] if leg.fresh else [0.0] * truth.n
        truth.place(leg.x, [0.0] * truth.n)
        runner.place(memory, [self.weather.box.inside(i, a + e) for i, (a, e) in enumerate(zip(leg.x, off, strict=True))])
        mode = k % self.weather.modes
        before = memory
        for row in range(rows):
            if row == rows // 2:
                mode = (mode + 1) % self.weather.modes
            seen = runner.ranges.copy()
            inputs = self._inputs(leg, row, random)
            dt = self._dt(leg, row, random)
            start = list(truth.x)
            if not self._stepped(mode, inputs, dt, random):
                return before
            if any(truth.cut) and inputs:  # the other way round it may stay within
                leg.places = {name: 1.0 - p if name.startswith("u.") else p for name, p in leg.places.items()}
                inputs = self._inputs(leg, row, random)
                truth.place(start, [0.0] * truth.n)
                if not self._stepped(mode, inputs, dt, random):
                    return before
            if any(truth.cut):  # and the estimate with it
                x = [a - c for a, c in zip(memory.arrays["kf.x"], truth.cut, strict=True)]
                runner.place(memory, [self.weather.box.inside(i, a) for i, a in enumerate(x)])
            self._noise()
            readings = {s.name: self._reading(mode, i, random) for i, s in enumerate(self.model.sensors)}
            if leg.dark and row >= rows // 2 and row < rows - 2:
                readings = {}
            before = memory.copy()
            runner.row(memory, inputs, dt, readings, row)
            if not self._within(memory):
                runner.ranges.restore(seen)
                return before
            self._note(leg, inputs, dt)
        return memory

    def _stepped(self, mode: int, inputs: dict[str, float], dt: float, random: Random) -> bool:
        """A step of the truth; False where it leaves the numbers."""
        self.truth.memory.numbers.update({f"u.{name}": value for name, value in inputs.items()})
        return self.truth.step(mode, dt, random)

    def _within(self, memory: Memory) -> bool:
        """Whether the estimate is not far outside of the box."""
        for value, span in zip(memory.arrays["kf.x"], self.weather.box.states, strict=True):
            if not math.isfinite(value):
                return False
            if span is not None and abs(value - clipped(value, span)) > BEYOND * (span[1] - span[0]):
                return False
        return True

    def _note(self, leg: Leg, inputs: dict[str, float], dt: float) -> None:
        """How far the row has gone."""
        given = {**dict(zip(self.model.states, self.truth.x, strict=True)), **inputs, **leg.parameters}
        if self.weather.run_time:
            given["dt"] = dt
        for name, value in given.items():
            self.seen.setdefault(name, Seen()).take(value)

    def _noise(self) -> None:
        n = self.truth.n
        for i in range(n):
            added = self.truth.last[i * n + i]
            if added > 0:
                self.least[i] = min(self.least[i], added)

    def _inputs(self, leg: Leg, row: int, random: Random) -> dict[str, float]:
        """At the ends of their ranges by turns, or about a place in them."""
        out = {}
        for i, name in enumerate(self.model.inputs):
            span, place = self.weather.box.inputs.get(name), leg.places[f"u.{name}"]
            if leg.corner:
                place = place if row // (HELD + 5 * i) % 2 == 0 else 1.0 - place
            else:
                place += 0.1 * (2 * random.random() - 1)
            out[name] = at((-1.0, 1.0) if span is None else span, place)
        return out

    def _dt(self, leg: Leg, row: int, random: Random) -> float:
        weather = self.weather
        if not weather.run_time:
            return weather.nominal
        span = weather.box.dt
        if span is None:
            return weather.nominal * (0.9 + 0.2 * random.random())
        if leg.corner:
            return span[int(leg.places["dt"] < 0.5) if row // HELD % 3 == 2 else int(leg.places["dt"] >= 0.5)]
        return at(span, random.random() ** 2) if row % 3 else weather.nominal

    def _reading(self, mode: int, k: int, random: Random) -> list[float]:
        sensor = self.model.sensors[k]
        ranges = self.weather.box.readings
        return [
            clipped(z, ranges.get((sensor.name, c.name)))
            for z, c in zip(self.truth.see(mode, k, random), sensor.spec.components, strict=True)
        ]
