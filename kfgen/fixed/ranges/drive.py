"""Drives all over the declared box, in legs.

A leg puts truth and estimate to a point of the box, gives the filter other parameters, and drives the inputs and the
step to their ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from kfgen.fixed.ranges.box import Box, Span, clipped
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.legs import Leg, at, legs
from kfgen.fixed.ranges.weather import Weather

DARK = 6  # the row from which on a dark leg has none
HELD = 6  # rows for which an input keeps its value, at least


@dataclass
class Seen:
    """How far the runs have gone in a quantity that has a declared range."""

    low: float = math.inf
    high: float = -math.inf

    def take(self, value: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)


class Player(Protocol):
    """What a drive is made with: a filter, or several side by side."""

    def begin(self, leg: Leg) -> None:
        """A leg begins, with a filter as it is after init or with what the leg before has left."""
        ...

    def estimate(self) -> list[float]:
        """The estimate (n)."""
        ...

    def place(self, x: Sequence[float]) -> None:
        """Put it to x (n)."""
        ...

    def row(self, inputs: Mapping[str, float], dt: float, readings: Mapping[str, Sequence[float]], k: int) -> bool:
        """A step and its updates; False, and nothing done, where the leg is to end."""
        ...


class Drive:
    """Makes the legs of a filter, row by row. outage: the rows of a dark leg that have no readings."""

    def __init__(self, weather: Weather, box: Box, outage: int) -> None:
        self.weather = weather
        self.box = box
        self.outage = outage
        self.truth = weather.truth
        self.model = weather.model
        self.seen: dict[str, Seen] = {}

    def run(self, player: Player, seed: int, inner: int, rows: int) -> None:
        """All legs: the corners, and `inner` ones. rows: of a leg, beside those without readings."""
        random = Random(seed)
        for k, leg in enumerate(legs(self.model, self.box, random, inner)):
            self._leg(player, leg, k, rows, random)

    def _leg(self, player: Player, leg: Leg, k: int, rows: int, random: Random) -> None:
        truth, n = self.truth, self.truth.n
        player.begin(leg)
        truth.begin(random)
        truth.memory.numbers.update({f"kf.parameters.{name}": value for name, value in leg.parameters.items()})
        off = [a - float(b) for a, b in zip(truth.x, self.model.x0, strict=True)] if leg.fresh else [0.0] * truth.nx
        truth.place(leg.x, [0.0] * n)
        self._place(player, [a + e for a, e in zip(leg.x, off, strict=True)])
        mode = k % self.weather.modes
        dark = range(DARK, DARK + self.outage) if leg.dark else range(0)
        for row in range(rows + len(dark)):
            if row == rows // 2:
                mode = (mode + 1) % self.weather.modes
            inputs, dt = self._inputs(leg, row, random), self._dt(leg, row, random)
            start = list(truth.x)
            there = self._stepped(mode, inputs, dt, random)
            if there and any(truth.cut) and inputs:  # the other way round it may stay within
                leg.places = {name: 1.0 - p if name.startswith("u.") else p for name, p in leg.places.items()}
                inputs = self._inputs(leg, row, random)
                truth.place(start, [0.0] * n)
                there = self._stepped(mode, inputs, dt, random)
            if not there:
                return
            if any(truth.cut):  # and the estimate with it
                self._place(player, [a - c for a, c in zip(player.estimate(), truth.cut, strict=True)])
            sensors = () if row in dark else self.model.sensors
            readings = {s.name: self._reading(leg, row, mode, i, random) for i, s in enumerate(sensors)}
            if not player.row(inputs, dt, readings, row):
                if row not in dark:
                    return
                dark = range(0)  # too much is unknown: the readings are back
            self._note(leg, inputs, dt)

    def _place(self, player: Player, x: Sequence[float]) -> None:
        inside = list(x)
        for i, _, part in self.model.space.singles:
            inside[i] = self.box.inside(i, x[i]) if part.flat else x[i]
        player.place(self.model.space.placed(inside))

    def _stepped(self, mode: int, inputs: dict[str, float], dt: float, random: Random) -> bool:
        """A step of the truth; False where it leaves the numbers."""
        self.truth.memory.numbers.update({f"u.{name}": value for name, value in inputs.items()})
        return self.truth.step(mode, dt, random)

    def _note(self, leg: Leg, inputs: dict[str, float], dt: float) -> None:
        """How far the row has gone."""
        given = {**dict(zip(self.model.states, self.truth.x, strict=True)), **inputs, **leg.parameters}
        if self.weather.run_time:
            given["dt"] = dt
        for name, value in given.items():
            self.seen.setdefault(name, Seen()).take(value)

    def _inputs(self, leg: Leg, row: int, random: Random) -> dict[str, float]:
        """At the ends of their ranges by turns, or about a place in them."""
        spans = [(name, self.box.inputs.get(name), f"u.{name}") for name in self.model.inputs]
        return {name: self._input(leg, row, i, span, key, random) for i, (name, span, key) in enumerate(spans)}

    def _input(self, leg: Leg, row: int, i: int, span: Span | None, key: str, random: Random) -> float:
        """The i-th of some inputs, its place in the leg under a key."""
        place = leg.places[key]
        if leg.corner:
            place = place if row // (HELD + 5 * i) % 2 == 0 else 1.0 - place
        else:
            place += 0.1 * (2 * random.random() - 1)
        return at((-1.0, 1.0) if span is None else span, place)

    def _dt(self, leg: Leg, row: int, random: Random) -> float:
        weather, span = self.weather, self.box.dt
        if not weather.run_time:
            return weather.nominal
        if span is None:
            return weather.nominal * (0.9 + 0.2 * random.random())
        if leg.corner:
            other = row >= DARK + self.outage and row // HELD % 3 == 2
            return span[int((leg.places["dt"] >= 0.5) != other)]
        return at(span, random.random() ** 2) if row % 3 else weather.nominal

    def _reading(self, leg: Leg, row: int, mode: int, k: int, random: Random) -> list[float]:
        sensor, spans = self.model.sensors[k], self.box.readings
        given = [
            self._input(leg, row, i, spans.get((sensor.name, name)), f"z.{sensor.name}.{name}", random)
            for i, name in enumerate(sensor.inputs)
        ]
        seen = self.truth.see(mode, k, random, given)
        names = [c.name for c in sensor.spec.components]
        return [*(clipped(z, spans.get((sensor.name, name))) for z, name in zip(seen, names, strict=True)), *given]
