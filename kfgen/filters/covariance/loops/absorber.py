"""The prediction of factors in loops: rank-one updates, two columns after another, from the factors of Q on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_one, is_positive, is_zero, require_nonnegative
from kfgen.filters.algebra.triangles import strict, strict_start, upper_start
from kfgen.filters.covariance.kernels.function import Kernels, Passed, integer
from kfgen.filters.covariance.kernels.points import remove
from kfgen.filters.covariance.kernels.updates import absorb
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import NEGATIVE, Additive, Factored
from kfgen.filters.frame.runs import Put, put
from kfgen.ir.trace import Array, Trace, Value


class Absorber:
    """U and D in the local arrays `factor` (strict upper triangle by columns) and `diagonal`, and what they absorb.

    names: of the states in the inner order. table: the name of a table in the emitted file. tables: see Form.
    """

    def __init__(self, names: list[str], kernels: Kernels, table: tuple[str, str]) -> None:
        """table: the filter's name, and what follows it."""
        self.n = len(names)
        self.names = names
        self.kernels = kernels
        self.table = table
        self.tables: dict[str, tuple[int, ...]] = {}

    def arrays(self, space: Space) -> tuple[Array, Array]:
        return space.array("factor", self.n * (self.n - 1) // 2), space.array("diagonal", self.n)

    def run(
        self, space: Space, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]], title: str,
        column_of: Callable[[Value, Put], None], weight: Callable[[int | Value], Value],
    ) -> None:  # fmt: skip
        """The arrays become the factors of Q + sum of d w w^T + sum of weight_k (F c_k)(F c_k)^T.

        column_of(k, entry): gives the entries 0 to k of c_k, those after are zero. c_0 is the first unit vector.
        """
        t = space.t
        t.section("Q")
        sure = self.start(t, space, Q)
        w = self.columns(space)
        for _, d in noise:
            require_nonnegative(d, NEGATIVE)
        if noise:
            t.section("process noise")
        for c in range(0, len(noise), 2):
            self.absorb_columns(space, sure, noise[c : c + 2])
        t.section(title)
        self._all_columns(space, sure, [row[0] for row in F], column_of, weight,
                          lambda start: self._transition(t, F, w, start), lambda pair: self._reach(t, F, pair))

    def add(
        self, space: Space, column_of: Callable[[Value, Put], None], weight: Callable[[int | Value], Value]
    ) -> None:
        """+ sum of weight_k c_k c_k^T, columns as of `run`."""
        n, t = self.n, space.t
        self.columns(space)
        unit: Vector = [t.one, *[t.zero] * (n - 1)]
        self._all_columns(space, False, unit, column_of, weight, lambda start: None, lambda k: 2 * k + (2 + n % 2))

    def _all_columns(
        self, space: Space, sure: bool, first: Vector, column_of: Callable[[Value, Put], None],
        weight: Callable[[int | Value], Value], change: Callable[[Value], None], reach: Callable[[Value], Value],
    ) -> None:  # fmt: skip
        """Columns in pairs. first: column 0 when changed. change: a column in w from a place on. reach: of a pair, how
        many leading entries may differ from zero."""
        n, t, w = self.n, space.t, self.columns(space)
        if n % 2:
            self.absorb_columns(space, sure, [(first, assume_nonnegative(weight(0)))])
        with t.loop("pair", 0, n // 2) as pair:
            k = 2 * pair + n % 2
            with t.loop("side", 0, 2) as side:
                start = side * n
                column_of(k + side, lambda i, value: w.__setitem__(start + i, value))
                change(start)
            weights = [assume_nonnegative(weight(place)) for place in (k, k + 1)]
            self.absorb(space, sure, weights, reach(pair))

    def columns(self, space: Space) -> Array:
        """Two columns to be absorbed, at zero; so they are afterwards."""
        new = "w" not in space.arrays
        w = space.array("w", 2 * self.n)
        if new:
            with space.t.loop("i", 0, 2 * self.n) as i:
                w[i] = 0
        return w

    def absorb(self, space: Space, sure: bool, weights: list[Value], count: Value) -> None:
        """The two columns, of which `count` leading entries may differ from zero. sure: D is known to be positive."""
        U, D = self.arrays(space)
        sure = sure and not self.kernels.several
        arrays: list[Passed] = [(each.name, 0) for each in (U, D, self.columns(space))]
        space.t.call(absorb(self.kernels, self.n, sure), [*arrays, *weights, count])

    def absorb_unit(self, space: Space, i: int, weight: Value) -> None:
        """+ weight e_i e_i^T; the columns have been asked for before."""
        t = space.t
        self.columns(space)[i] = 1
        self.absorb(space, False, [weight, t.zero], integer(t, i + 1))

    def remove(self, space: Space, c: Array, s: Value, tolerance: Fraction, known: Fraction | None) -> Value:
        """- c c^T / s; the condition that the result is indefinite beyond `tolerance`. known: a D up to this part of
        the variance is a direction without spread."""
        t = space.t
        left = space.array("left", 1)
        arrays: list[Passed] = [(each.name, 0) for each in (*self.arrays(space), c)]
        limits = [] if known is None else [t.value(known)]
        t.call(remove(self.kernels, self.n, known is None), [*arrays, s, *limits, (left.name, 0)])
        rest = t.name(left[0], "left_over")
        t.flag(rest < 0, "REGULARIZED")
        return ~(rest >= -(s * tolerance))

    def learn(self, space: Space, field: str, rate: Fraction, sure: bool, steps: Sequence[tuple[Array, Value]]) -> None:
        """See loops.motion.Learner; the field holds the factors as a Kept does."""
        n, t = self.n, space.t
        U, D = self.arrays(space)
        w = self.columns(space)
        with t.loop("j", 0, n) as j:
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = t.element(field, upper_start(j) + i)
            D[j] = t.element(field, upper_start(j) + j) * (1 - rate)
        for c in range(0, len(steps), 2):
            pair = steps[c : c + 2]
            with t.loop("i", 0, n) as i:
                for side, (gain, step) in enumerate(pair):
                    w[i + side * n] = gain[i] * step
            self.absorb(space, sure, [t.value(rate), t.value(rate if len(pair) > 1 else 0)], integer(t, n))
        with t.loop("j", 0, n) as j:
            with t.loop("i", 0, j) as i:
                t.store(field, upper_start(j) + i, U[strict_start(j) + i])
            t.store(field, upper_start(j) + j, D[j])

    def add_spread(
        self, space: Space, spread: list[tuple[Array, Number]], place: Callable[[Value], Value]
    ) -> None:
        """+ sum of v d d^T over some (d, v), d (n,) in the spec's order, two at a time."""
        t, n, w = space.t, self.n, self.columns(space)
        for c in range(0, len(spread), 2):
            pair = spread[c : c + 2]
            with t.loop("i", 0, n) as i:
                at = place(i)
                for side, (array, _) in enumerate(pair):
                    w[i + side * n] = array[at]
            weights = [assume_nonnegative(t.value(weight)) for _, weight in pair]
            self.absorb(space, False, [*weights, t.zero][:2], integer(t, n))

    def absorb_columns(self, space: Space, sure: bool, columns: list[tuple[Vector, Value]]) -> None:
        """One or two columns (vector, weight), of which the entries are known one by one."""
        t, n = space.t, self.n
        none: tuple[Vector, Value] = ([t.zero] * n, t.zero)
        (a, weight_a), (b, weight_b) = [*columns, none][:2]
        last = max((i for i in range(n) if not is_zero(a[i]) or not is_zero(b[i])), default=-1)
        put(t, self.columns(space).__setitem__, {i: x for i, x in enumerate([*a, *b]) if not is_zero(x)})
        self.absorb(space, sure, [weight_a, weight_b], integer(t, last + 1))

    def start(self, t: Trace, space: Space, Q: Additive) -> bool:
        """The arrays hold the factors of Q; whether all of D is known to be positive."""
        n = self.n
        U, D = self.arrays(space)
        UQ, DQ = Q.factors()
        if isinstance(Q, Factored) and Q.field:
            with t.loop("j", 0, n) as at:
                with t.loop("i", 0, at) as above:
                    U[strict_start(at) + above] = t.element(Q.field, upper_start(at) + above)
                D[at] = t.element(Q.field, upper_start(at) + at)
        else:
            flat = {strict(row, col): t.value(UQ[row][col]) for col in range(n) for row in range(col)}
            if any(is_zero(u) for u in flat.values()):
                with t.loop("i", 0, len(flat)) as i:
                    U[i] = 0
                flat = {place: u for place, u in flat.items() if not is_zero(u)}
            put(t, U.__setitem__, flat)
            fill(t, D, DQ)
        return all(is_positive(d) for d in DQ)

    def _transition(self, t: Trace, F: Rows, w: Array, start: Value) -> None:
        """w <- F w by unrolled products, w from `start` on; rows of the identity leave their entry."""
        old: Vector = [t.name(w[start + i], f"w_{name}") for i, name in enumerate(self.names)]
        for i, row in enumerate(F):
            if not (is_one(row[i]) and all(is_zero(x) for k, x in enumerate(row) if k != i)):
                w[start + i] = t.value(linalg.dot(row, old))

    def _reach(self, t: Trace, F: Rows, pair: Value) -> Value:
        """How many leading entries of a pair of columns may differ from zero once F has been applied."""
        n = self.n
        last = [max((i for i in range(n) if not is_zero(F[i][j])), default=0) for j in range(n)]
        counts = [1 + max(last[: j + 1]) for j in range(1 + n % 2, n, 2)]
        if counts == [n] * len(counts):
            return integer(t, n)
        self.tables = {self.table[1]: tuple(counts)}
        return t.wrapped(t.pool.make("element", (pair.node,), "_".join(self.table), "int"))
