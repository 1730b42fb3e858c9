"""What straight-line updates move the state by: gains and innovations as numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra.linalg import Rows, Vector, dot, plus, times
from kfgen.filters.algebra.numbers import Number
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.kept import Kept
from kfgen.filters.covariance.parts import Place
from kfgen.filters.frame import guards
from kfgen.ir.trace import Trace, Value


@dataclass(frozen=True)
class Moved:
    """dx (n,) in the inner order, and the steps K_i nu_i that it is the sum of."""

    t: Trace
    order: list[int]
    total: Vector
    steps: tuple[Vector, ...] = ()

    def by(self, K: Vector, nu: Value) -> Moved:
        """One step more."""
        step = [times(k, nu) for k in K]
        total = [plus(m, dx) for m, dx in zip(self.total, step, strict=True)]
        return Moved(self.t, self.order, total, (*self.steps, step))

    def entries(self) -> Vector:
        return list(self.total)

    def along(self, h: Vector) -> Number:
        return dot(h, self.total)

    def state(self, x: list[Value], names: Sequence[str], place: Place) -> list[Value]:
        t, out = self.t, list(x)
        for i, m in zip(self.order, self.total, strict=True):
            out[i] = t.name(t.value(plus(x[i], m)), f"{names[i]}_next")
        return out

    def learnt(self, kept: Kept, rate: Fraction) -> Learnt:
        entries, factors = kept.learnt(self.t, list(self.steps), rate)
        guards.finite(self.t, [self.t.value(entries[i, i]) for i in range(kept.k)])
        return Learnt(self.t, kept, entries, factors)


@dataclass(frozen=True)
class Learnt:
    """The next Q, as entries and, where these are kept, as factors."""

    t: Trace
    kept: Kept
    entries: Symmetric
    factors: tuple[Rows, Vector] | None
    early = False

    def store(self) -> None:
        self.kept.store(self.t, self.entries, self.factors)


@dataclass(frozen=True)
class VectorGain:
    """K (n,) of a scalar measurement, s its innovation variance. inverse: 1 / s as the gain has made it."""

    K: Vector
    s: Value
    innovation: Callable[[Moved], Value]
    inverse: Number | None = None
    sound: bool = False
    spoilt: Value | None = None

    def applied(self, motion: Moved) -> tuple[Moved, Number]:
        nu = self.innovation(motion)
        motion = motion.by(self.K, nu)
        return motion, nu * (nu * (1 / self.s if self.inverse is None else self.inverse))
