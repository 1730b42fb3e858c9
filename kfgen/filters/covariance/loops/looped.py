"""What the forms in loops have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Protocol, Self

from kfgen.filters.base import Block
from kfgen.filters.covariance.base import Form, Straight
from kfgen.filters.covariance.kernels.function import Kernels
from kfgen.filters.covariance.loops.motion import Displacement
from kfgen.filters.covariance.loops.space import Space, kept_in_array
from kfgen.ir.trace import Trace, Value


class Spaced(Protocol):
    """A covariance in the arrays of a space."""

    @property
    def space(self) -> Space: ...


@dataclass(frozen=True)
class Looping:
    """What the loops of a filter are to do. names: of the states in the inner order. weighted: whether measurements
    may have a weight. steps: whether what each measurement moves the state by is asked for (adapt_Q). table: the
    filter's name, and what follows it in the name of a table of indices."""

    names: list[str]
    kernels: Kernels
    weighted: bool
    steps: bool
    table: tuple[str, str]


class Looped(ABC):
    """Covariances stand in arrays; private functions do what is done to them.

    sibling: the same form in straight-line code. learns_early: see Learning.
    """

    indexed = True
    group = 1
    learns_early = False
    n: int
    order: list[int]

    def __init__(self, sibling: Straight[Any], how: Looping) -> None:
        self.sibling = sibling
        self.names = how.names
        self.kernels = how.kernels
        self.weighted = how.weighted
        self.steps = how.steps

    def straight(self) -> Straight[Any]:
        return self.sibling

    def mixer(self, forms: Sequence[Form[Any]]) -> Self | None:
        """Itself, where all are of this form, in this order."""
        return self if all(isinstance(each, type(self)) and each.order == self.order for each in forms) else None

    def named(self, blocks: list[Block]) -> list[Block]:
        return [replace(block, entries=()) for block in blocks]

    def kept(self, t: Trace, x: list[Value], before: list[Value]) -> list[Value]:
        return kept_in_array(t, x, before)

    def at_rest(self, t: Trace, P: Spaced) -> Displacement:
        return Displacement(P.space, self.n, self.learn, self.learns_early)

    @abstractmethod
    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        """See loops.motion.Learner."""
