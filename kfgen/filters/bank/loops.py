"""Mixtures of the estimates of modes in loops: what `mixing` does, for modes that keep their covariances alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kfgen.filters.algebra.linalg import Vector, minus, plus, times
from kfgen.filters.algebra.numbers import Number, is_zero, select
from kfgen.filters.bank.mixing import Joining, joining
from kfgen.filters.bank.trace import BankTrace, Scope
from kfgen.filters.covariance.loops.space import Space
from kfgen.filters.covariance.parts import Mixer
from kfgen.geometry import Line, heaviest
from kfgen.ir.trace import Array, Value
from kfgen.model import Model


@dataclass(frozen=True)
class Source:
    """A mode's estimate in the struct. place: from an inner position to a state of the spec."""

    t: BankTrace
    scope: Scope
    place: Callable[[Value], Value]

    def element(self, field: str) -> Callable[[int | Value], Value]:
        """An element of a field, by its index."""

        def element(index: int | Value) -> Value:
            with self.t.of(self.scope):
                return self.t.element(field, index)

        return element

    def state(self, k: int | Value) -> Value:
        with self.t.of(self.scope):
            return self.t.name(self.t.element("kf.x", k), "state")


@dataclass(frozen=True)
class Weighed:
    """A source with its weight in a mixture."""

    source: Source
    weight: Number

    def element(self, field: str) -> Callable[[int | Value], Value]:
        return self.source.element(field)


def mixed_in_loops(
    t: BankTrace, model: Model, sources: list[Source], weights: list[Number], own: int, mixer: Mixer
) -> dict[str, Array]:
    """Local arrays that hold what the fields of mode `own` would, of the mixture with these weights. mixer: its own."""
    others = [i for i in range(len(sources)) if i != own and not is_zero(weights[i])]
    parts = [own, *others] if not is_zero(weights[own]) else others
    steps = list(joining(weights, parts))
    for step in steps:
        t.name(t.value(step.share), "share")
        t.name(t.value(step.weight), "spread")
    weighed = [Weighed(source, weight) for source, weight in zip(sources, weights, strict=True)]
    with t.of(sources[own].scope):
        x, spread = _state(t, Space(t), model, [sources[i] for i in parts], [weights[i] for i in parts], steps)
        P = mixer.mixture(t, weighed[own], [weighed[i] for i in others], spread, sources[own].place)
        return {"kf.x": x, **P}


def _state(
    t: BankTrace, space: Space, model: Model, sources: list[Source], weights: list[Number], steps: list[Joining]
) -> tuple[Array, list[tuple[Array, Number]]]:
    """The mean, and the columns of the spread with their weights, in the spec's order."""
    n = len(model.states)
    mixed = space.array("x", n)
    columns = [(space.array(f"spread{k}", n), step.weight) for k, step in enumerate(steps)]

    def state(k: int | Value) -> None:
        part = model.space.singles[k][2] if isinstance(k, int) else Line()
        values = [source.state(k) for source in sources]
        base = values[0] if part.flat else t.name(heaviest(values, weights, select), "base")
        deltas: Vector = [0 if value is base else part.local(value, base) for value in values]
        mean = deltas[0]
        for (array, _), step, delta in zip(columns, steps, deltas[1:], strict=True):
            e = t.name(t.value(minus(delta, mean)), "apart")
            array[k] = e
            mean = plus(mean, times(step.share, e))
        total = t.value(plus(base, mean))
        mixed[k] = part.placed(total)

    start = 0
    for stop in range(n + 1):
        if stop < n and model.space.singles[stop][2].flat:
            continue
        if stop - start == 1:
            state(start)
        elif stop > start:
            with t.loop("k", start, stop) as k:
                state(k)
        if stop < n:
            state(stop)
        start = stop + 1
    return mixed, columns
