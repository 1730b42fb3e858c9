"""Factors of a predicted covariance gathered from the deviations of sigma points, in loops throughout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.numbers import assume_nonnegative, is_zero
from kfgen.filters.covariance.base import P
from kfgen.filters.covariance.loops.absorber import Absorber
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Weight
from kfgen.filters.frame import guards
from kfgen.ir.trace import Array, Trace, Value


class LoopedFactors(Generic[P]):
    """U D U^T, or its root, by private functions that absorb a column or take one away."""

    rewrites = True

    def __init__(
        self, t: Trace, absorber: Absorber, order: list[int], Q: Additive, columns: list[tuple[Vector, Value]],
        how: Gathering, finish: Callable[[Space], P],
    ) -> None:  # fmt: skip
        """order: inner position -> state. finish: what the form makes of U, D in the absorber's arrays."""
        assert how.absorb is not None
        self.t = t
        self.absorber = absorber
        self.order = order
        self.finish = finish
        self.n = len(order)
        self.function = how.absorb
        self.tolerance = 8 * self.n * how.epsilon
        self.space = Space(t)
        self.failures: list[Value] = []
        absorber.start(t, self.space, Q)
        self.w = self.space.array("column", self.n)
        for w, d in columns:
            if not is_zero(d):
                self.add(w, assume_nonnegative(d))

    def _row(self, target: Array, array: Array, at: Value) -> None:
        straight = self.order == list(range(self.n))
        with self.t.loop("i", 0, self.n) as i:
            target[i] = array[at + i] if straight else array[at + ((self.n - 1) - i)]

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """+ weight d d^T of the deviations from `at` on."""
        self._row(self.w, array, at)
        self._call(weight)

    def add(self, d: Vector, weight: Weight) -> None:
        fill(self.t, self.w, d)
        self._call(weight)

    def _call(self, weight: Weight) -> None:
        U, D = self.absorber.arrays(self.space)
        self.t.call(self.function, [(U.name, 0), (D.name, 0), (self.w.name, 0), self.t.value(weight)])

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """- weight d d^T; nothing has been stored yet."""
        t = self.t
        total = t.variable("size", 0)
        with t.loop("i", 0, self.n) as i:
            total.set(total.get() + array[at + i])
        guards.finite(t, [total.get()])
        c = self.space.array("c", self.n)
        self._row(c, array, at)
        t.guard(self._removed(c, weight), "NOT_POSITIVE")

    def subtract(self, d: Vector, weight: Weight) -> None:
        c = self.space.array("c", self.n)
        fill(self.t, c, d)
        self.failures.append(self._removed(c, weight))

    def _removed(self, c: Array, weight: Weight) -> Value:
        return self.absorber.remove(self.space, c, 1 / self.t.value(weight), self.tolerance, None)

    def result(self) -> tuple[P, list[Value]]:
        return self.finish(self.space), self.failures
