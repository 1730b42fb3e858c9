"""Symmetric matrices whose entries are made when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.filters.algebra.linalg import Rows, Vector, dot, minus, plus, times
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, is_constant, is_one, is_zero


class Symmetric:
    """A symmetric matrix whose entries are made when they are first asked for.

    What is asked for first is computed first: gains and guards before the bulk, each entry just before its store.
    """

    def __init__(self, n: int, entry: Callable[[int, int], Number]) -> None:
        self.n = n
        self._entry = entry
        self._made: dict[tuple[int, int], Number] = {}

    def __getitem__(self, ij: tuple[int, int]) -> Number:
        key = (min(ij), max(ij))
        if key not in self._made:
            self._made[key] = self._entry(*key)
        return self._made[key]

    def times(self, h: Vector) -> Vector:
        """P h^T."""
        return [self.dot(i, h) for i in range(self.n)]

    def dot(self, i: int, h: Vector) -> Number:
        """Row i times h."""
        return dot([0 if is_zero(hj) else self[i, j] for j, hj in enumerate(h)], h)

    def downdated(self, measurement: Measurement, c: Vector, K: Vector) -> Symmetric:
        """P - g K s K^T after a measurement. c: P h^T = s K.

        Where h measures a single state by a constant, its row is h P' = r K^T: cheaper, and without the difference
        of nearly equal numbers.
        """
        h, r = measurement.h, measurement.r
        weighted = [times(measurement.g, k) for k in K]
        seen = [j for j, x in enumerate(h) if not is_zero(x)]
        single = seen[0] if len(seen) == 1 and is_constant(h[seen[0]]) else -1

        def entry(i: int, j: int) -> Number:
            if is_zero(K[i]) or is_zero(c[j]):
                return self[i, j]
            if single in (i, j):
                k = K[j if i == single else i]
                return r * k if is_one(h[single]) else r / h[single] * k
            return self[i, j] - weighted[i] * c[j]

        return Symmetric(self.n, entry)

    def joseph(
        self, measurement: Measurement, c: Vector, K: Vector, changed: bool = False, lift: Number = 0
    ) -> Symmetric:
        """(I - g K h) P (I - g K h)^T + g r K K^T for any gain: A = (I - g K h) P, then A - g (A h^T - r K) K^T.

        c: P h^T. changed: K is not the optimal gain. lift: what comes to r in the variances of states that are not
        themselves measured.
        """
        h, r, g = measurement.h, measurement.r, measurement.g
        weighted = [times(g, k) for k in K]
        seen = [j for j, x in enumerate(h) if not is_zero(x)]
        # a state that is measured exactly is known exactly, not up to rounding
        single = seen[0] if len(seen) == 1 and is_constant(h[seen[0]]) else -1
        known = single if is_zero(r) and is_one(g) and not changed else -1

        def partial(i: int, j: int) -> Number:
            return self[i, j] if is_zero(K[i]) or is_zero(c[j]) else self[i, j] - weighted[i] * c[j]

        rest: Vector = []
        for i, k in enumerate(K):
            a = dot([0 if is_zero(hj) else partial(i, j) for j, hj in enumerate(h)], h)
            rest.append(minus(times(k, r), a))

        def entry(i: int, j: int) -> Number:
            if known in (i, j):
                return self[i, j] * 0
            a = partial(i, j)
            if is_zero(rest[i]) or is_zero(K[j]):
                return a
            return a + (plus(rest[i], times(K[i], lift)) if i == j != single else rest[i]) * weighted[j]

        return Symmetric(self.n, entry)

    def congruent(self, F: Rows) -> Symmetric:
        """F P F^T. The sparser of two rows is the outer factor."""
        weight = [sum(not is_zero(x) for x in row) for row in F]
        made: dict[tuple[int, int], Number] = {}

        def product(i: int, k: int) -> Number:
            """(F P)_ik."""
            if (i, k) not in made:
                made[i, k] = self.dot(k, F[i])
            return made[i, k]

        def entry(i: int, j: int) -> Number:
            outer, inner = (i, j) if weight[i] <= weight[j] else (j, i)
            return dot([0 if is_zero(x) else product(inner, k) for k, x in enumerate(F[outer])], F[outer])

        return Symmetric(len(F), entry)

    def changed(self, change: Callable[[int, int, Number], Number]) -> Symmetric:
        """Every entry through a function."""
        return Symmetric(self.n, lambda i, j: change(i, j, self[i, j]))


def assembled(U: Rows, D: Vector) -> Symmetric:
    """U D U^T."""
    n = len(D)

    def entry(i: int, j: int) -> Number:
        total = D[j] if i == j else times(U[i][j], D[j])
        for k in range(j + 1, n):
            total = plus(total, times(times(U[j][k], D[k]), U[i][k]))
        return total

    return Symmetric(n, entry)
