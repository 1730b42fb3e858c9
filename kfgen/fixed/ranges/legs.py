"""Where runs over the declared box begin: at its corners, and at points that fill it (a Latin hypercube)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from kfgen.fixed.ranges.box import Box, Span
from kfgen.fixed.ranges.generator import Random
from kfgen.model import Model

LEGS = 24
CORNER = 1 / 2  # the share of legs that begin and drive at the ends of everything
NEAR = 1e-6  # of a range: how near to its end a corner is
VANISHING = 1 / 32  # the same where the lower end of a parameter is 0, in every other leg


@dataclass
class Leg:
    """Where one begins, what it is given: parameters by name, and what a row draws inputs and dt from.

    places: of each quantity in [0, 1], where it is kept around; 0 and 1 are the ends. fresh: with the covariance of the
    first estimate, and not with what the leg before has left. vanishing: a parameter may be 0, and what a noise of
    nothing leaves has no size.
    """

    corner: bool
    fresh: bool
    dark: bool  # without readings for some time
    x: list[float]
    parameters: dict[str, float]
    places: dict[str, float] = field(default_factory=dict)
    vanishing: bool = False


def legs(model: Model, box: Box, random: Random, count: int = LEGS) -> Iterator[Leg]:
    """Legs all over the box of a filter."""
    names = [*(f"x.{s}" for s in model.states), *(f"p.{name}" for name, _ in model.parameters),
             *(f"u.{name}" for name in model.inputs), "dt"]  # fmt: skip
    cube = {name: _shuffled(count, random) for name in names}
    places: dict[str, float] = {}
    for k in range(count):
        corner = k < CORNER * count
        if corner and k % 2:
            places = {name: 1.0 - place for name, place in places.items()}  # the opposite corner
        else:
            places = {name: (cube[name][k] + random.random()) / count for name in names}
        if corner:
            places = {name: float(place >= 0.5) for name, place in places.items()}
        x = []
        for i, (state, start) in enumerate(zip(model.states, model.x0, strict=True)):
            span = box.states[i]
            x.append(float(start) if span is None else at(span, places[f"x.{state}"]))
        parameters = {name: float(value) for name, value in model.parameters}
        vanishing = k % 5 == 1 and any(span[0] == 0 for span in box.parameters.values())
        for name, span in box.parameters.items():
            place = places[f"p.{name}"]
            if span[0] == 0:
                place = max(place, 0.0 if vanishing else VANISHING)
            parameters[name] = span[0] if place == 0 == span[0] else at(span, place)
        yield Leg(corner, k % 4 < 2, k % 3 == 2, x, parameters, places, vanishing)


def _shuffled(count: int, random: Random) -> list[int]:
    order = list(range(count))
    for i in reversed(range(1, count)):
        j = int(random.random() * (i + 1))
        order[i], order[j] = order[j], order[i]
    return order


def at(span: Span, place: float) -> float:
    """The point of a span at a place in [0, 1], a little inside."""
    low, high = span
    place = min(max(place, NEAR), 1.0 - NEAR)
    return low + (high - low) * place
