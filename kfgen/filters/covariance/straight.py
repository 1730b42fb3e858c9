"""What the forms in straight-line code have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Self

from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.base import Block
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.motion import Moved
from kfgen.filters.covariance.noise import Additive
from kfgen.ir.trace import Trace, Value


class StraightLine(ABC):
    """Every number is a value of its own."""

    indexed = False
    tables: Mapping[str, tuple[int, ...]] = {}
    order: list[int]

    def straight(self) -> Self:
        return self

    def mixer(self, forms: Sequence[Form[Any]]) -> None:
        return None

    def named(self, blocks: list[Block]) -> list[Block]:
        return blocks

    def kept(self, t: Trace, x: list[Value], before: list[Value]) -> list[Value]:
        return x

    def turned(self, t: Trace, P: Any, T: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Any:
        return self.predict(t, P, T, Q, noise)

    @abstractmethod
    def predict(self, t: Trace, P: Any, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> Any:
        """See Form."""

    def at_rest(self, t: Trace, P: Any) -> Moved:
        return Moved(t, self.order, [0] * len(self.order))
