"""A triangular root in arrays, as loops hold it."""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.filters.algebra.triangles import strict, strict_start
from kfgen.filters.covariance.loops.space import Space
from kfgen.filters.covariance.sqrt.store import SqrtStore
from kfgen.ir.trace import Value


@dataclass(frozen=True)
class ArrayRoot:
    """S, upper triangular in the inner order: that of the struct, or in the function's own arrays, of which only the
    last version counts: `factor` above the diagonal, `diagonal`."""

    space: Space
    store: SqrtStore
    own: bool

    def at(self, i: int | Value, j: int | Value) -> Value:
        """S_ij, i < j."""
        t = self.space.t
        if self.own:
            return self.space.arrays["factor"][(strict_start(j) if isinstance(j, Value) else strict(0, j)) + i]
        return t.element("kf.S", self.store.spot(t, i, j))

    def diagonal(self, j: int | Value) -> Value:
        """S_jj."""
        t = self.space.t
        return self.space.arrays["diagonal"][j] if self.own else t.element("kf.S", self.store.spot(t, j, j))
