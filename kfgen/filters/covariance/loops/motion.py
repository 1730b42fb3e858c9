"""What looped updates move the state by: gains in local arrays, times innovations that are not added up at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra.linalg import Vector, dot, plus, times
from kfgen.filters.algebra.numbers import Number, is_positive, is_zero, select
from kfgen.filters.algebra.triangles import upper_start
from kfgen.filters.covariance.kept import Kept
from kfgen.filters.covariance.loops.space import Space
from kfgen.filters.covariance.parts import GainChange, Place
from kfgen.filters.frame import guards
from kfgen.ir.trace import Array, Trace, Value

Learner = Callable[["Displacement", str, Fraction, bool], None]
"""Has Q <- (1 - rate) Q + rate sum of dx dx^T in a field of the struct; the last argument: Q is known to be definite.

Nothing can fail any more when it is called.
"""


class Displacement:
    """dx (n,): the local array `moved`, if it is in use, and gains times innovations that have not been added to it.

    learner: of the form; early: whether it has to be called while the arrays of P are as they are.
    """

    def __init__(
        self, space: Space, n: int, learner: Learner, early: bool, array: Array | None = None,
        terms: tuple[tuple[Array, Value], ...] = (),
    ) -> None:  # fmt: skip
        self.space = space
        self.t = space.t
        self.n = n
        self.learner = learner
        self.early = early
        self.array = array
        self.terms = terms

    def with_terms(self, array: Array | None, terms: tuple[tuple[Array, Value], ...]) -> Displacement:
        return Displacement(self.space, self.n, self.learner, self.early, array, terms)

    def at(self, i: int | Value) -> Number:
        total: Number = 0 if self.array is None else self.array[i]
        for gain, step in self.terms:
            total = plus(total, gain[i] * step)
        return total

    def entries(self) -> Vector:
        return [self.at(i) for i in range(self.n)]

    def along(self, h: Vector) -> Number:
        return dot(h, [0 if is_zero(x) else self.at(i) for i, x in enumerate(h)])

    def settle(self) -> None:
        """Add what is left to the array, before an array of a gain is used anew."""
        array = self.space.array("moved", self.n)
        with self.t.loop("i", 0, self.n) as i:
            array[i] = self.at(i)
        self.array, self.terms = array, ()

    def state(self, x: list[Value], names: Sequence[str], place: Place) -> list[Value]:
        t, at = self.t, place(self.t)
        out = t.array("x_next", self.n)
        with t.loop("i", 0, self.n) as i:
            k = at(i)
            out[k] = t.element("kf.x", k) + self.at(i)
        return [out[i] for i in range(self.n)]

    def learnt(self, kept: Kept, rate: Fraction) -> Learnt:
        """Tests that the next Q is finite."""
        t, field = self.t, f"kf.{kept.field}"
        total = t.variable(t.unique("trace"), 0)
        with t.loop("i", 0, self.n) as i:
            value = t.element(field, upper_start(i) + i)
            for gain, step in self.terms:
                dx = gain[i] * step
                value = value + dx * dx
            total.set(total.get() + value)
        guards.finite(t, [total.get()])
        sure = all(is_positive(d) for d in kept.factors(t)[1]) if kept.factored else False
        return Learnt(self, field, rate, sure)


@dataclass(frozen=True)
class Learnt:
    """What stores the next Q."""

    moved: Displacement
    field: str
    rate: Fraction
    sure: bool

    @property
    def early(self) -> bool:
        return self.moved.early

    def store(self) -> None:
        self.moved.learner(self.moved, self.field, self.rate, self.sure)


@dataclass(frozen=True)
class ArrayGain:
    """A gain in a local array, times a factor. step: the innovation that it is to be applied to."""

    t: Trace
    array: Array
    nu: Value
    s: Value
    sound: bool
    factor: Value | None = None
    inverse: Value | None = None  # 1 / s, as it stands in factor
    spoilt: Value | None = None

    def at(self, i: int | Value) -> Number:
        return times(self.array[i], 1 if self.factor is None else self.factor)

    def applied(self, motion: Displacement) -> tuple[Displacement, Number]:
        step = self.t.name(self.nu if self.factor is None else self.factor * self.nu, "step")
        motion = motion.with_terms(motion.array, (*motion.terms, (self.array, step)))
        return motion, self.nu * (self.nu * (1 / self.s if self.inverse is None else self.inverse))


@dataclass(frozen=True)
class AppliedGain:
    """A gain that a private function has applied at once. square: nu^2 / s."""

    moved: Array
    s: Value
    square: Value
    sound: bool
    spoilt: Value | None = None

    def applied(self, motion: Displacement) -> tuple[Displacement, Number]:
        return motion.with_terms(self.moved, ()), self.square


def array_of_gain(space: Space, name: str, n: int, motion: Displacement, steps: bool) -> Array:
    """The array of a gain, to be written. steps: one of its own for every measurement, since all are asked for in the
    end; else what gains before it have moved the state by is no longer read from it."""
    if steps:
        before = len(motion.terms)
        return space.array(f"{name}_{before}" if before else name, n)
    known = space.arrays.get(name)
    if any(gain == known for gain, _ in motion.terms):
        motion.settle()
    return space.array(name, n)


def start_moved(space: Space, n: int, motion: Displacement) -> Array:
    """The array `moved` of gains that are applied at once; zero where nothing has moved yet."""
    fresh = motion.array is None
    array = space.array("moved", n)
    if fresh:
        with space.t.loop("i", 0, n) as i:
            array[i] = 0
    return array


def changed_gain(t: Trace, change: GainChange, gain: Array, difference: Array | None, n: int) -> None:
    """The gain as consider and gain_limit make it, in place; difference: what it has changed by."""
    limit = change.limit
    with t.loop("i", 0, n) as i:
        k = t.name(gain[i], "k_i")
        new = k
        if limit is not None:
            beyond = (k > limit) | (k < -limit)
            for place in sorted(change.considered):
                beyond = beyond & ((i < place) | (i > place))
            t.flag(beyond, "REGULARIZED")
            new = t.name(select(k > limit, limit, select(k < -limit, -limit, k)), "k_limited")
            gain[i] = new
        if difference is not None:
            difference[i] = new - k
    for place in sorted(change.considered):
        if difference is not None:
            difference[place] = difference[place] - gain[place]
        gain[place] = 0
