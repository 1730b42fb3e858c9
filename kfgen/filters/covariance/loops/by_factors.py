"""What the forms in loops that keep factors have in common: U D U^T and S S^T are changed in the same two arrays."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.triangles import strict_start
from kfgen.filters.covariance.base import Straight
from kfgen.filters.covariance.kernels.function import Passed
from kfgen.filters.covariance.loops.absorber import Absorber
from kfgen.filters.covariance.loops.looped import Looped, Looping
from kfgen.filters.covariance.loops.motion import AppliedGain, ArrayGain, Displacement, array_of_gain, start_moved
from kfgen.filters.covariance.loops.space import Space
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Scalar
from kfgen.filters.frame.runs import Put
from kfgen.ir.program import Function
from kfgen.ir.trace import Trace, Value


class ByFactors(Looped):
    """absorber: of U and D, which are what S is changed in, too. rooted: D is that of S between two steps."""

    rooted = False

    def __init__(self, sibling: Straight[Any], how: Looping) -> None:
        super().__init__(sibling, how)
        self.absorber = Absorber(how.names, how.kernels, how.table)

    @property
    def tables(self) -> Mapping[str, tuple[int, ...]]:
        return self.absorber.tables

    def measured(
        self, space: Space, scalar: Scalar, motion: Displacement, moves: bool,
        function: Function, row: Callable[[], list[Passed]],
    ) -> AppliedGain | ArrayGain:  # fmt: skip
        """What a private function that takes a scalar measurement into the factors makes of it.

        moves: whether it applies the gain at once. row: what it is told of h.
        """
        t, n, measurement = space.t, self.n, scalar.measurement
        nu = scalar.innovation(motion)
        U, D = self.absorber.arrays(space)
        target: list[Passed]
        if moves:
            moved = start_moved(space, n, motion)
            target = [t.value(nu), (moved.name, 0)]
        else:
            gain = array_of_gain(space, "gain", n, motion, self.steps)
            target = [(gain.name, 0)]
        s = space.array("s", 2)
        weight = [t.value(measurement.g)] if self.weighted else []
        told = [*row(), t.value(measurement.r), *weight]
        t.call(function, [(U.name, 0), (D.name, 0), *told, *target, (s.name, 0)])
        variance = t.name(s[0], "variance")
        if moves:
            return AppliedGain(moved, variance, s[1], sound=True)
        return ArrayGain(t, gain, nu, variance, sound=True)

    def turned(self, t: Trace, P: Any, T: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Any:
        """The columns of the factors, turned, are absorbed anew."""
        P = self._owned(P)
        space, n = P.space, self.n
        U, D = self.absorber.arrays(space)
        columns, diagonal = space.array("factor_before", n * (n - 1) // 2), space.array("diagonal_before", n)
        with t.loop("i", 0, n * (n - 1) // 2) as i:
            columns[i] = U[i]
        with t.loop("i", 0, n) as i:
            diagonal[i] = D[i]

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k) as i:
                entry(i, columns[strict_start(k) + i])
            entry(k, diagonal[k] if self.rooted else t.one)

        def weight(k: int | Value) -> Value:
            if not self.rooted:
                return t.value(diagonal[k])
            first = isinstance(k, int) and k == 0  # its column is taken as a unit vector
            return t.value(diagonal[0] * diagonal[0]) if first else t.one

        self.absorber.turn(space, T, Q, noise, column_of, weight)
        return self._turned(P)

    @abstractmethod
    def _owned(self, P: Any) -> Any:
        """P in arrays that may be changed."""

    def _turned(self, P: Any) -> Any:
        """P once U D U^T stands in the arrays."""
        return P

    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        self.absorber.learn(moved.space, field, rate, sure, moved.terms)
