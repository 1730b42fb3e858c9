"""What steps exchange with a form of the covariance: measurements, gains, motions, gathered points, mixtures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import or_
from typing import Any, Protocol, TypeVar

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, is_zero, select
from kfgen.filters.covariance.kept import Kept
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value

P_co = TypeVar("P_co", covariant=True)
Weight = Value | Fraction
Place = Callable[[Trace], Callable[[Value], Value]]
"""Gives, in a trace, the way from an inner position, a loop's counter, to the state of the spec."""


@dataclass(frozen=True)
class GainChange:
    """What `consider` and `gain_limit` make of a gain; a limit that is met is flagged. considered: inner positions."""

    considered: frozenset[int]
    limit: Fraction | None

    def __call__(self, K: Vector) -> Vector:
        K = [0 if i in self.considered else k for i, k in enumerate(K)]
        limit = self.limit
        if limit is None:
            return K
        beyond = [(k > limit) | (k < -limit) for k in K if not is_zero(k)]
        if beyond:
            beyond[0].trace.flag(reduce(or_, beyond), "REGULARIZED")
        return [k if is_zero(k) else select(k > limit, limit, select(k < -limit, -limit, k)) for k in K]


class Learning(Protocol):
    """The next Q of an adaptation, tested to be finite."""

    @property
    def early(self) -> bool:
        """Whether it has to be stored before P is."""
        ...

    def store(self) -> None: ...


class Motion(Protocol):
    """By how much an update has moved the state so far, dx (n,) in the inner order."""

    def entries(self) -> Vector:
        """dx (n,)."""
        ...

    def along(self, h: Vector) -> Number:
        """h dx."""
        ...

    def state(self, x: list[Value], names: Sequence[str], place: Place) -> list[Value]:
        """x + dx, not yet in its chart. x (n,) and names in the spec's order, as is what is returned."""
        ...

    def learnt(self, kept: Kept, rate: Fraction) -> Learning:
        """Q <- (1 - rate) Q + rate times the sum of dx_i dx_i^T over the measurements, Q as it is kept."""
        ...


@dataclass(frozen=True)
class Scalar:
    """A scalar measurement, and its innovation after what those before it have moved; it may be asked for once."""

    measurement: Measurement
    innovation: Callable[[Any], Value]


class Gain(Protocol):
    """What an update has made of a scalar measurement. s: the innovation variance.

    sound: s > 0 by the way it is computed, where r > 0. spoilt: condition under which rounding has spoilt the
    covariance, so that s and the gain are no use; no error, since it can be mended.
    """

    @property
    def s(self) -> Value: ...

    @property
    def sound(self) -> bool: ...

    @property
    def spoilt(self) -> Value | None: ...

    def applied(self, motion: Any) -> tuple[Motion, Number]:
        """motion (that of the same form) with K nu, and nu^2 / s."""
        ...


class Gatherer(Protocol[P_co]):
    """A covariance gathered from deviations of sigma points: starts at Q and takes them in the inner order."""

    rewrites: bool
    """Whether deviations are read from the array of the points, and have to stand there less the mean's shift."""

    def add_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """+ w d d^T in a loop, w >= 0, of the deviations d that stand in the array from `at` on."""
        ...

    def subtract_row(self, array: Array, at: Value, d: Vector, weight: Weight) -> None:
        """- w d d^T in a loop, w > 0; it fails where the result is not positive semidefinite."""
        ...

    def add(self, d: Vector, weight: Weight) -> None:
        """+ w d d^T after the loops."""
        ...

    def subtract(self, d: Vector, weight: Weight) -> None:
        """- w d d^T after the loops."""
        ...

    def result(self) -> tuple[P_co, list[Value]]:
        """The covariance, and conditions of failure."""
        ...


@dataclass(frozen=True)
class Gathering:
    """How deviations come in. names: of the states in the inner order. common: the weight of all points, if it is one.

    in_loops: loops or a private function (`absorb`, for factors) take each in, whatever the form; not for negative
    weights. checked: negative weights may leave a full covariance indefinite.
    """

    names: list[str]
    common: Fraction | None
    epsilon: Fraction
    in_loops: bool
    absorb: Function | None
    checked: bool


@dataclass(frozen=True)
class Removal:
    """How a column is taken away. tolerance: what is negative within it, relative, is round-off. sure: what is left is
    positive, but for rounding that leaves variances so. definite: it is nonnegative, but for any rounding."""

    tolerance: Fraction
    sure: bool
    definite: bool


class Part(Protocol):
    """An estimate in the struct that takes part in a mixture."""

    @property
    def weight(self) -> Number: ...

    def element(self, field: str) -> Callable[[int | Value], Value]:
        """The elements of a field, by their index."""
        ...


class Mixer(Protocol):
    """Mixes covariances of its form in loops over the fields that hold them."""

    def mixture(
        self, t: Trace, own: Part, others: list[Part], spread: list[tuple[Array, Number]],
        place: Callable[[Value], Value],
    ) -> dict[str, Array]:
        """Local arrays that hold sum w_i P_i + sum v_k d_k d_k^T as the fields of the struct would, by their paths.

        spread: d_k (n,) in the spec's order and v_k. place: from an inner position to a state of the spec.
        """
        ...


@dataclass(frozen=True)
class Columns:
    """The columns of a root, each (n,) in the inner order, and conditions under which there is none."""

    columns: list[Vector]
    failures: list[Value]
