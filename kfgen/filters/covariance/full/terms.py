"""A full covariance as it stands in an array, less the terms of measurements that have not been taken from it yet."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kfgen.filters.algebra.linalg import minus, times
from kfgen.filters.algebra.numbers import Number
from kfgen.filters.algebra.triangles import upper, upper_size, upper_start
from kfgen.filters.covariance.kernels.function import Kernels, Passed, integer
from kfgen.filters.covariance.kernels.rows import put_row
from kfgen.filters.covariance.loops.space import Space
from kfgen.filters.frame.runs import Put
from kfgen.ir.trace import Array, Value

PENDING = 4  # measurements that are taken together, in one pass over P


@dataclass(frozen=True)
class Term:
    """- weight c c^T of a measurement, c in a local array.

    state: the one that it measures, if it is a single one: row and column of P are then share c, which is what is
    left without the difference of nearly equal numbers.
    """

    c: Array
    weight: Value
    state: int | None = None
    share: Value | None = None


@dataclass(frozen=True)
class ArrayEntries:
    """P0 (n, n) less the terms. P0 is that of the struct, or a local array: packed, or square."""

    space: Space
    n: int
    kernels: Kernels
    array: str = ""  # empty: the struct's
    square: bool = False
    terms: tuple[Term, ...] = ()

    def at(self, i: int | Value, j: int | Value) -> Value:
        """Entry i <= j of P0."""
        t = self.space.t
        if self.square:
            return Array(t, self.array)[j * self.n + i]
        return self.at_place(upper_start(j) + i if isinstance(j, Value) else upper(0, j) + i)

    def at_place(self, place: int | Value) -> Value:
        """An entry of a packed P0."""
        t = self.space.t
        return Array(t, self.array)[place] if self.array else t.element("kf.P", place)

    def start(self, *states: int) -> int:
        """The last term that tells the row of one of some states afresh; -1: none."""
        return max((k for k, term in enumerate(self.terms) if term.state in states), default=-1)

    def entry(self, i: int, j: int) -> Value:
        """P_ij, i <= j."""
        t, start = self.space.t, self.start(i, j)
        if start < 0:
            total: Number = self.at(i, j)
        else:
            term = self.terms[start]
            total = times(term.share, term.c[j if term.state == i else i])
        for term in self.terms[start + 1 :]:
            total = minus(total, times(times(term.weight, term.c[i]), term.c[j]))
        return t.value(total)

    def written(self) -> ArrayEntries:
        """P in a packed array of the function's own, without terms."""
        if self.array and not self.terms and not self.square:
            return self
        target = self.space.array("covariance", upper_size(self.n))
        self.write(target.name, target.__setitem__)
        return ArrayEntries(self.space, self.n, self.kernels, target.name)

    def write(self, target: str, put_at: Put) -> None:
        """All entries into a packed array."""
        t, n = self.space.t, self.n
        if self.terms:
            self._less_terms(target, put_at)
        elif self.square:
            with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
                put_at(upper_start(j) + i, self.at(i, j))
        else:
            with t.loop("k", 0, upper_size(n)) as k:
                put_at(k, self.at_place(k))

    def _less_terms(self, target: str, put_at: Put) -> None:
        """P0 less the terms. A row that is told afresh starts at its share of c; earlier terms leave it alone."""
        t, n = self.space.t, self.n
        source, last = self.array, target == "kf.P"
        hidden: list[tuple[Array, int, Value]] = []
        if any(term.state is not None for term in self.terms) and target != (self.array or "kf.P"):
            with t.loop("k", 0, upper_size(n)) as k:
                put_at(k, self.at_place(k))
            source = target
        for number, term in enumerate(self.terms):
            if term.state is None or term.share is None:
                continue
            given: list[Passed] = [(target, 0), integer(t, term.state), (term.c.name, 0), term.share]
            t.call(put_row(self.kernels, n), given)
            for earlier in self.terms[: number + 1]:
                if not last:
                    hidden.append((earlier.c, term.state, t.name(earlier.c[term.state], "hidden")))
                earlier.c[term.state] = 0
        P = replace(self, array="" if source == "kf.P" else source)
        with t.loop("j", 0, n) as j:
            parts = [t.name(term.c[j] * term.weight, "part") for term in P.terms]
            with t.loop("i", 0, j + 1) as i:
                total = P.at(i, j)
                for term, part in zip(P.terms, parts, strict=True):
                    total = total - term.c[i] * part
                put_at(upper_start(j) + i, total)
        for c, state, value in reversed(hidden):  # the gains are still asked for
            c[state] = value
