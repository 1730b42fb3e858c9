"""Mixtures of the estimates of modes in loops: what `mixing` does, for modes that keep their covariances alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kfgen.filters.algebra.linalg import Vector, minus, plus, times
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_zero, reciprocal
from kfgen.filters.bank.mixing import Joining, heaviest, joining
from kfgen.filters.bank.trace import BankTrace, Scope
from kfgen.filters.covariance.base import Rolled
from kfgen.filters.covariance.full.loops import RolledFull
from kfgen.filters.covariance.looped import Space, integer
from kfgen.filters.covariance.sqrt.loops import RolledSqrt, Root
from kfgen.filters.covariance.ud.loops import RolledUD
from kfgen.filters.frame.runs import Put
from kfgen.filters.frame.triangles import strict_start, upper_start
from kfgen.ir.trace import Array, Value
from kfgen.model import Model


@dataclass(frozen=True)
class Source:
    """A mode's estimate in the struct. place: from an inner position to a state of the spec."""

    scope: Scope
    layout: Rolled
    place: Callable[[Value], Value]

    def element(self, t: BankTrace, name: str) -> Callable[[int | Value], Value]:
        """An element of a field, by its index."""

        def element(index: int | Value) -> Value:
            with t.of(self.scope):
                return t.element(name, index)

        return element

    def state(self, t: BankTrace, k: int | Value) -> Value:
        with t.of(self.scope):
            return t.name(t.element("kf.x", k), "state")


def alike(layouts: list[Rolled]) -> bool:
    """Whether these covariances can be mixed in loops: all are of one form, in one order."""
    first = layouts[0]
    return all(each.rolled and type(each) is type(first) and each.order == first.order for each in layouts)


def mixed_in_loops(
    t: BankTrace, model: Model, sources: list[Source], weights: list[Number], own: int
) -> dict[str, Array]:
    """Local arrays that hold what the fields of mode `own` would, of the mixture with these weights."""
    others = [i for i in range(len(sources)) if i != own and not is_zero(weights[i])]
    parts = [own, *others] if not is_zero(weights[own]) else others
    steps = list(joining(weights, parts))
    for step in steps:
        t.name(t.value(step.share), "share")
        t.name(t.value(step.weight), "spread")
    with t.of(sources[own].scope):
        space = Space(t)
        x, columns = _state(t, space, model, [sources[i] for i in parts], [weights[i] for i in parts], steps)
        return {"kf.x": x, **_Mixture(t, space, sources, weights, own, others, columns).arrays()}


def _state(
    t: BankTrace, space: Space, model: Model, sources: list[Source], weights: list[Number], steps: list[Joining]
) -> tuple[Array, list[tuple[Array, Number]]]:
    """The mean, and the columns of the spread with their weights, in the spec's order."""
    n = len(model.states)
    mixed = space.array("x", n)
    columns = [(space.array(f"spread{k}", n), step.weight) for k, step in enumerate(steps)]

    def state(k: int | Value) -> None:
        period = model.periods[k] if isinstance(k, int) else None
        values = [source.state(t, k) for source in sources]
        base = values[0] if period is None else t.name(_heaviest(values, weights), "base")
        deltas: Vector = [0 if value is base else value - base for value in values]
        if period is not None:
            deltas = [t.wrap(d, period) if isinstance(d, Value) else d for d in deltas]
        mean = deltas[0]
        for (array, _), step, delta in zip(columns, steps, deltas[1:], strict=True):
            e = t.name(t.value(minus(delta, mean)), "apart")
            array[k] = e
            mean = plus(mean, times(step.share, e))
        total = t.value(plus(base, mean))
        mixed[k] = total if period is None else t.wrap(total, period)

    start = 0
    for stop in range(n + 1):
        if stop < n and model.periods[stop] is None:
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


def _heaviest(values: list[Value], weights: list[Number]) -> Value:
    return values[0] if len(values) == 1 else heaviest(values, weights)


class _Mixture:
    """The covariance of a mixture: sum of w_i P_i, and the columns of the spread."""

    def __init__(self, t: BankTrace, space: Space, sources: list[Source], weights: list[Number], own: int,
                 others: list[int], columns: list[tuple[Array, Number]]) -> None:  # fmt: skip
        self.t = t
        self.space = space
        self.sources = sources
        self.weights = weights
        self.own = own
        self.others = others
        self.columns = columns
        self.n = sources[own].layout.n

    def arrays(self) -> dict[str, Array]:
        layout = self.sources[self.own].layout
        if isinstance(layout, RolledFull):
            return {"kf.P": self._entries()}
        if isinstance(layout, RolledUD):
            return self._factors(layout)
        assert isinstance(layout, RolledSqrt)
        return self._root(layout)

    def _entries(self) -> Array:
        """P, packed."""
        t, n = self.t, self.n
        P = self.space.array("P", n * (n + 1) // 2)
        used = [i for i in (self.own, *self.others) if not is_zero(self.weights[i])]
        parts = [(self.sources[i].element(t, "kf.P"), self.weights[i]) for i in used]
        with t.loop("j", 0, n) as j:
            scaled = [t.name(t.value(times(array[j], weight)), "part") for array, weight in self.columns]
            with t.loop("i", 0, j + 1) as i:
                place = upper_start(j) + i
                total: Number = 0
                for element, weight in parts:
                    total = plus(total, times(weight, element(place)))
                for (array, _), part in zip(self.columns, scaled, strict=True):
                    total = plus(total, array[i] * part)
                P[place] = t.value(total)
        return P

    def _factors(self, layout: RolledUD) -> dict[str, Array]:
        t, n, absorber = self.t, self.n, layout.absorber
        U, D = absorber.arrays(self.space)
        own, weight = self.sources[self.own], self.weights[self.own]
        u, d = own.element(t, "kf.U"), own.element(t, "kf.D")
        with t.loop("i", 0, n * (n - 1) // 2) as i:
            U[i] = 0 if is_zero(weight) else u(i)
        with t.loop("i", 0, n) as i:
            D[i] = t.value(times(weight, d(i)))
        for part in self.others:
            upper, diagonal = (self.sources[part].element(t, name) for name in ("kf.U", "kf.D"))

            def column_of(k: Value, entry: Put, upper: Callable[[int | Value], Value] = upper) -> None:
                with t.loop("i", 0, k) as i:
                    entry(i, upper(strict_start(k) + i))
                entry(k, t.one)

            def factor(
                k: int | Value, diagonal: Callable[[int | Value], Value] = diagonal, w: Number = self.weights[part]
            ) -> Value:
                return t.value(times(w, assume_nonnegative(diagonal(k))))

            absorber.add(self.space, column_of, factor)
        self._spread(layout)
        return {"kf.U": U, "kf.D": D}

    def _root(self, layout: RolledSqrt) -> dict[str, Array]:
        """By way of U D U^T, as a prediction."""
        t, n, absorber = self.t, self.n, layout.absorber
        U, D = absorber.arrays(self.space)
        weight, source = self.weights[self.own], self.sources[self.own].element(t, "kf.S")
        with t.loop("j", 0, n) as j:
            d = t.name(source(layout.spot(t, j, j)), "d")
            inverse = t.name(reciprocal(assume_nonnegative(d))[1], "inverse")
            D[j] = t.value(times(weight, d * d))
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = 0 if is_zero(weight) else source(layout.spot(t, i, j)) * inverse
        for part in self.others:
            entry_of = self.sources[part].element(t, "kf.S")

            def column_of(k: Value, entry: Put, entry_of: Callable[[int | Value], Value] = entry_of) -> None:
                with t.loop("i", 0, k + 1) as i:
                    entry(i, entry_of(layout.spot(t, i, k)))

            def factor(
                k: int | Value, entry_of: Callable[[int | Value], Value] = entry_of, w: Number = self.weights[part]
            ) -> Value:
                if isinstance(k, int):  # its column is taken as a unit vector
                    first = entry_of(layout.spot(t, k, k))
                    return t.value(times(w, first * first))
                return t.value(w)

            absorber.add(self.space, column_of, factor)
        self._spread(layout)
        layout.take_roots(self.space)
        return layout.placed(Root(self.space, own=True))

    def _spread(self, layout: RolledUD | RolledSqrt) -> None:
        """The columns of the spread, two at a time."""
        t, n, absorber = self.t, self.n, layout.absorber
        place = self.sources[self.own].place
        w = absorber.columns(self.space)
        for c in range(0, len(self.columns), 2):
            pair = self.columns[c : c + 2]
            with t.loop("i", 0, n) as i:
                at = place(i)
                for side, (array, _) in enumerate(pair):
                    w[i + side * n] = array[at]
            weights = [assume_nonnegative(t.value(weight)) for _, weight in pair]
            absorber.absorb(self.space, False, [*weights, t.zero][:2], integer(t, n))
