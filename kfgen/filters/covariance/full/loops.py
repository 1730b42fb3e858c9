"""The upper triangle of P in loops: for size; the same field and the same numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from fractions import Fraction

from kfgen.filters.algebra.limits import Limits
from kfgen.filters.algebra.linalg import Rows, Vector, dot, plus, times
from kfgen.filters.algebra.numbers import Number, is_one, is_zero, select, sqrt
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.algebra.triangles import upper, upper_size, upper_start
from kfgen.filters.base import Block
from kfgen.filters.covariance.full.gather import LoopedEntries, add_noise, indefinite
from kfgen.filters.covariance.full.rounding import not_negative, single_state
from kfgen.filters.covariance.full.store import FullStore
from kfgen.filters.covariance.full.straight import StraightFull, round_off
from kfgen.filters.covariance.full.terms import PENDING, ArrayEntries, Term
from kfgen.filters.covariance.full.updates import Updates
from kfgen.filters.covariance.loops.looped import Looped, Looping
from kfgen.filters.covariance.loops.motion import ArrayGain, Displacement
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Part, Removal, Scalar
from kfgen.filters.frame.runs import put
from kfgen.ir.trace import Array, Trace, Value


class LoopedFull(Looped, FullStore):
    """Standard updates gather their terms and write P once; Joseph's change a copy of P."""

    learns_early = True
    tables: Mapping[str, tuple[int, ...]] = {}

    def __init__(self, sibling: StraightFull, how: Looping) -> None:
        Looped.__init__(self, sibling, how)
        FullStore.__init__(self, sibling.n, how.kernels)
        self.epsilon = sibling.epsilon
        self.form = sibling.form
        self.updates = Updates(how.kernels, sibling.form, sibling.change, sibling.epsilon, how.steps)

    def plain(self) -> LoopedFull:
        if self.updates.change is None:
            return self
        other = copy(self)
        other.updates = replace(self.updates, change=None)
        return other

    def blocks(self, P0: list[list[Fraction]], names: Sequence[str]) -> list[Block]:
        return [replace(block, compact=True) for block in super().blocks(P0, names)]

    def load(self, t: Trace) -> ArrayEntries:
        return ArrayEntries(Space(t), self.n, self.kernels)

    # predict -----------------------------------------------------------------------------------------

    def predict(self, t: Trace, P: ArrayEntries, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]
                ) -> ArrayEntries:  # fmt: skip
        """P <- F P on the columns of a square array, then, of its transpose, again."""
        n, space = self.n, P.space
        additive = Q.entries()
        a = space.array("product", n * n)
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            value = t.name(P.at(i, j), "value")
            a[j * n + i] = value
            a[i * n + j] = value
        t.section("F P F^T: F times every column of P, and again of the transpose")
        with t.loop("side", 0, 2) as side:
            with t.loop("k", 0, n) as k:
                start = k * n
                old = [t.name(a[start + m], f"p_{name}") for m, name in enumerate(self.names)]
                for m, row in enumerate(F):
                    if not (is_one(row[m]) and all(is_zero(x) for other, x in enumerate(row) if other != m)):
                        a[start + m] = t.value(dot(row, list(old)))
            with t.when(side < 1), t.loop("j", 1, n) as j, t.loop("i", 0, j) as i:
                value = t.name(a[j * n + i], "value")
                a[j * n + i] = a[i * n + j]
                a[i * n + j] = value
        t.section("+ Q")
        add_noise(t, a, additive, noise, square=True)
        return ArrayEntries(space, n, self.kernels, a.name, square=True)

    # update ------------------------------------------------------------------------------------------

    def update(
        self, t: Trace, P: ArrayEntries, measurements: list[Scalar], motion: Displacement
    ) -> tuple[ArrayEntries, list[ArrayGain]]:
        return self.updates.update(t, P, measurements, motion)

    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        t, n = moved.space.t, self.n
        with t.loop("j", 0, n) as j:
            parts = [t.name(gain[j] * step * step * rate, "part") for gain, step in moved.terms]
            with t.loop("i", 0, j + 1) as i:
                total = t.element(field, upper_start(j) + i) * (1 - rate)
                for (gain, _), part in zip(moved.terms, parts, strict=True):
                    total = total + gain[i] * part
                t.store(field, upper_start(j) + i, total)

    # sigma points -----------------------------------------------------------------------------------

    def root(self, t: Trace, P: ArrayEntries, tolerance: Fraction, stored: bool, in_loops: bool) -> Array:
        if stored:
            return self.root_array(t, tolerance, None)
        if P.terms and P.array:  # taken from the array itself, they would be taken again by who goes on with P
            left = P.space.array("left", upper_size(self.n))
            P.write(left.name, left.__setitem__)
            return self.root_array(t, tolerance, left)
        return self.root_array(t, tolerance, Array(t, P.written().array))

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> LoopedEntries:
        return LoopedEntries(t, self.kernels, Q, noise, how)

    def downdated(
        self, t: Trace, P: ArrayEntries, c: Vector, s: Number, how: Removal, prior: ArrayEntries
    ) -> tuple[ArrayEntries, Value]:
        """One more term; what rounding has left of a variance below zero is taken for zero."""
        if len(P.terms) == PENDING:
            P = P.written()
        space, n = P.space, self.n
        array = space.array(f"c{len(P.terms)}", n)
        fill(t, array, c)
        weight = t.name(t.value(1 / s), "weight")
        P = replace(P, terms=(*P.terms, Term(array, weight)))
        if how.definite:
            return P, t.wrapped(t.pool.boolean(False))
        P = P.written()
        own, worst = Array(t, P.array), t.variable(t.unique("worst"), 0)
        with t.loop("i", 0, n) as i:
            place = upper_start(i) + i
            variance = t.name(own[place], "variance")
            before = variance + array[i] * array[i] * weight
            # the points' rounding is in c
            worst.set(select(variance < -(before * (1024 * how.tolerance)), 1, worst.get()))
            low = t.name(variance < 0, "negative")
            t.flag(low, "REGULARIZED")
            own[place] = select(low, 0, variance)
        return P, worst.get() > 0

    def bounded(
        self, t: Trace, P: ArrayEntries, prior: ArrayEntries, share: Value, tolerance: Fraction
    ) -> tuple[ArrayEntries, Value]:
        doubtful = t.name(share < tolerance, "doubtful")
        before = P.space.array("before", self.n)
        with t.when(doubtful), t.loop("i", 0, self.n) as i:
            before[i] = prior.at(i, i)
        P = P.written()
        own = Array(t, P.array)
        with t.when(doubtful), t.loop("i", 0, self.n) as i:
            place = upper_start(i) + i
            variance, least = t.name(own[place], "variance"), t.name(before[i] * share, "least")
            t.flag(variance < 0, "REGULARIZED")
            # without noise what is left is nothing but rounding
            low = t.name(variance < select(share > 0, least, before[i] * tolerance), "low")
            own[place] = select(low, least, variance)
        return P, doubtful

    def indefinite(self, P: ArrayEntries, tolerance: Fraction) -> tuple[ArrayEntries, list[Value]]:
        P = P.written()
        return P, [indefinite(P, tolerance)]

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: ArrayEntries) -> Symmetric:
        return Symmetric(self.n, lambda i, j: P.entry(i, j))

    def variance(self, P: ArrayEntries, h: Vector) -> Number:
        spread = dot(h, self.entries(P).times(h))
        return spread if single_state(h) >= 0 and not P.terms and not P.array else not_negative(spread)

    def tolerance(self, P: ArrayEntries, h: Vector) -> Value | int:
        return round_off(self.entries(P), h, self.epsilon)

    def inflated(self, P: ArrayEntries, a: Number) -> ArrayEntries:
        P = P.written()
        array = Array(P.space.t, P.array)
        with P.space.t.loop("k", 0, self.n * (self.n + 1) // 2) as k:
            array[k] = array[k] * a
        return P

    def limit(
        self, t: Trace, P: ArrayEntries, floors: Limits, ceilings: Limits, epsilon: Fraction
    ) -> ArrayEntries:
        if not P.square:
            P = P.written()
        n, array = self.n, Array(t, P.array)

        def place(i: int | Value, j: int | Value) -> int | Value:
            if P.square:
                return j * n + i
            return (upper_start(j) if isinstance(j, Value) else upper(0, j)) + i

        def limited(i: int, limit: Fraction, below: bool) -> Value:
            variance = t.name(array[place(i, i)], f"p_{self.names[i]}")
            beyond = t.name(variance < limit if below else variance > limit, "beyond")
            t.flag(beyond, "REGULARIZED")
            array[place(i, i)] = select(beyond, limit, variance)
            return t.value(1 if below else select(beyond, sqrt(limit / variance), 1))

        for i, floor in enumerate(floors):
            if floor is not None:
                limited(i, floor, below=True)
        if all(ceiling is None for ceiling in ceilings):
            return P
        scale = P.space.array("row", n)
        put(t, scale.__setitem__, [t.one if high is None else t.name(limited(i, high, below=False), "root")
                                   for i, high in enumerate(ceilings)])  # fmt: skip
        with t.loop("j", 1, n) as j, t.loop("i", 0, j) as at:
            array[place(at, j)] = array[place(at, j)] * (scale[at] * scale[j])
        return P

    def evidence(self, P: ArrayEntries, after_predict: bool) -> list[Value]:
        if not (after_predict or self.form == "joseph"):
            return []
        t, n = P.space.t, self.n
        total = t.variable(t.unique("trace"), 0)
        with t.loop("i", 0, n) as i:
            part = P.at(i, i)
            for term in P.terms:
                part = plus(part, term.weight * (term.c[i] * term.c[i]))
            total.set(total.get() + t.value(part))
        return [total.get()]

    def store(self, t: Trace, P: ArrayEntries, names: list[str], after_predict: bool) -> None:
        if P.array or P.terms:
            P.write("kf.P", lambda place, value: t.store("kf.P", place, value))
            t.later(lambda: self.settle(t))

    # mixtures ----------------------------------------------------------------------------------------

    def mixture(
        self, t: Trace, own: Part, others: list[Part], spread: list[tuple[Array, Number]],
        place: Callable[[Value], Value],
    ) -> dict[str, Array]:  # fmt: skip
        n = self.n
        P = t.array("P", upper_size(n))
        parts = [(part.element("kf.P"), part.weight) for part in (own, *others) if not is_zero(part.weight)]
        with t.loop("j", 0, n) as j:
            scaled = [t.name(t.value(times(array[j], weight)), "part") for array, weight in spread]
            with t.loop("i", 0, j + 1) as i:
                at = upper_start(j) + i
                total: Number = 0
                for element, weight in parts:
                    total = plus(total, times(weight, element(at)))
                for (array, _), part in zip(spread, scaled, strict=True):
                    total = plus(total, array[i] * part)
                P[at] = t.value(total)
        return {"kf.P": P}
