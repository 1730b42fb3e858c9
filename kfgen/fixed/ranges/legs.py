"""Where runs over the declared box begin: at its corners, and at points that fill it (a Latin hypercube)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from kfgen.fixed.ranges.box import Box, Span
from kfgen.fixed.ranges.generator import Random
from kfgen.model import Model

FEWEST, MOST = 8, 16  # corners
NEAR = 1e-6  # of a range: how near to its end a corner is
VANISHING = 1 / 32  # the same where the lower end of a parameter is 0, in every other corner


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


def legs(model: Model, box: Box, random: Random, inner: int) -> Iterator[Leg]:
    """Legs all over the box of a filter: corners first, each with an outage.

    Of parameters and dt all ends meet, as far as there are corners enough; they decide how a covariance grows.
    """
    slow = [*(f"p.{name}" for name in box.parameters), *(["dt"] if box.dt else [])]
    quick = [f"x.{s}" for s in model.states] + [f"u.{name}" for name in model.inputs] + ["dt"]
    quick += [f"z.{s.name}.{name}" for s in model.sensors for name in s.inputs]
    corners = _corners(slow, quick, random)
    names = [*quick, *(f"p.{name}" for name in box.parameters)]
    cube = {name: _shuffled(inner, random) for name in names}
    for k in range(len(corners) + inner):
        corner, j = k < len(corners), k - len(corners)
        places = corners[k] if corner else {name: (cube[name][j] + random.random()) / inner for name in names}
        x = []
        for i, (state, start) in enumerate(zip(model.states, model.x0, strict=True)):
            span = box.states[i]
            x.append(float(start) if span is None else at(span, places[f"x.{state}"]))
        parameters = {name: float(value) for name, value in model.parameters}
        vanishing = corner and k % 2 == 1 and any(span[0] == 0 for span in box.parameters.values())
        for name, span in box.parameters.items():
            place = places[f"p.{name}"]
            if span[0] == 0:
                place = max(place, 0.0 if vanishing else VANISHING)
            parameters[name] = span[0] if place == 0 == span[0] else at(span, place)
        yield Leg(corner, k % 4 < 2, corner or k % 3 == 2, x, parameters, places, vanishing)


def _corners(slow: list[str], quick: list[str], random: Random) -> list[dict[str, float]]:
    """Ends of all quantities: of the slow ones in all combinations or in many, of the quick ones by chance."""
    every = 1 << len(slow)
    count = min(max(every, FEWEST), MOST)
    chosen = _shuffled(every, random) if every <= count else [0, every - 1] + [
        int(random.random() * every) for _ in range(count - 2)
    ]  # fmt: skip
    out: list[dict[str, float]] = []
    for k in range(count):
        if k % 2 and out:  # the opposite corner
            places = {name: 1.0 - place for name, place in out[-1].items()}
        else:
            places = {name: float(random.random() >= 0.5) for name in quick}
        ends = chosen[k % len(chosen)]
        out.append(places | {name: float(ends >> i & 1) for i, name in enumerate(slow)})
    return out


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
