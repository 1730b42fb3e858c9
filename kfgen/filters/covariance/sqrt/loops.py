"""The lower Cholesky factor in loops: for size; the same field and the same numbers."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.filters.algebra.limits import Limits, margin
from kfgen.filters.algebra.linalg import Rows, Vector, times
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_positive,
    is_zero,
    reciprocal,
    sqrt,
)  # fmt: skip
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.algebra.triangles import strict_start
from kfgen.filters.covariance.kernels.function import Passed, integer
from kfgen.filters.covariance.kernels.points import remove_root
from kfgen.filters.covariance.kernels.updates import carlson
from kfgen.filters.covariance.loops.by_factors import ByFactors
from kfgen.filters.covariance.loops.gather import LoopedFactors
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.loops.motion import AppliedGain, ArrayGain, Displacement
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gathering, Part, Removal, Scalar
from kfgen.filters.covariance.sqrt.root import ArrayRoot
from kfgen.filters.covariance.sqrt.store import SqrtStore
from kfgen.filters.covariance.sqrt.straight import StraightSqrt
from kfgen.filters.frame.runs import Put
from kfgen.ir.trace import Array, Trace, Value


class LoopedSqrt(ByFactors, SqrtStore):
    """The same steps as the straight sibling's."""

    def __init__(self, sibling: StraightSqrt, how: Looping) -> None:
        ByFactors.__init__(self, sibling, how)
        SqrtStore.__init__(self, sibling.n)

    def plain(self) -> LoopedSqrt:
        return self

    def load(self, t: Trace) -> ArrayRoot:
        return ArrayRoot(Space(t), self, own=False)

    def _owned(self, P: ArrayRoot) -> ArrayRoot:
        """S in arrays that may be changed."""
        if P.own:
            return P
        t = P.space.t
        U, D = self.absorber.arrays(P.space)
        with t.loop("j", 0, self.n) as j:
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = P.at(i, j)
            D[j] = P.diagonal(j)
        return ArrayRoot(P.space, self, own=True)

    def predict(self, t: Trace, P: ArrayRoot, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]
                ) -> ArrayRoot:  # fmt: skip
        """S S^T <- F S S^T F^T + Q + sum of d w w^T: U D U^T first, one root per state at the end."""

        def weight(k: int | Value) -> Value:
            if k == 0 and isinstance(k, int):  # its column is taken as a unit vector
                first = P.diagonal(0)
                return first * first
            return t.one

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k + 1) as i:
                entry(i, P.at(i, k))

        self.absorber.run(P.space, F, Q, noise, "F S S^T F^T + Q, two columns of F S after another", column_of, weight)
        t.section("roots")
        self._take_roots(P.space)
        return ArrayRoot(P.space, self, own=True)

    def _take_roots(self, space: Space) -> None:
        """From U D U^T in the arrays of the absorber to S S^T."""
        t = space.t
        U, D = self.absorber.arrays(space)
        with t.loop("j", 0, self.n) as j:
            root = t.name(sqrt(assume_nonnegative(D[j])), "root")
            D[j] = root
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = U[strict_start(j) + i] * root

    def update(
        self, t: Trace, P: ArrayRoot, measurements: list[Scalar], motion: Displacement
    ) -> tuple[ArrayRoot, list[AppliedGain | ArrayGain]]:
        (scalar,) = measurements
        measurement, moves = scalar.measurement, not self.steps
        P = self._owned(P)
        space = P.space
        function = carlson(self.kernels, self.n, is_positive(measurement.r), self.weighted, moves)

        def row() -> list[Passed]:
            first, last = space.row(measurement.h)
            return [("h", 0), integer(t, first), integer(t, last)]

        return P, [self.measured(space, scalar, motion, moves, function, row)]

    def downdated(
        self, t: Trace, P: ArrayRoot, c: Vector, s: Number, how: Removal, prior: ArrayRoot
    ) -> tuple[ArrayRoot, Value]:
        n, space = self.n, P.space
        if "small" not in space.arrays:
            small = space.array("small", n)
            with t.loop("j", 0, n) as j:
                last = t.name(prior.diagonal(j), "last")
                total = t.variable("total", last * last)
                with t.loop("k", j + 1, n) as k:
                    s_jk = t.name(prior.at(j, k), "s_jk")
                    total.set(total.get() + s_jk * s_jk)
                small[j] = total.get() * (how.tolerance * how.tolerance)
        P = self._owned(P)
        array, told = space.array("c", n), space.array("told", 2)
        fill(t, array, c)
        arrays: list[Passed] = [(each.name, 0) for each in (*self.absorber.arrays(space), array, space.arrays["small"])]
        t.call(remove_root(self.kernels, n), [*arrays, t.value(s), t.value(how.tolerance), (told.name, 0)])
        t.flag(told[1] > 0, "REGULARIZED")
        return P, told[0] > 0

    def indefinite(self, P: ArrayRoot, tolerance: Fraction) -> tuple[ArrayRoot, list[Value]]:
        """Never: it is a square."""
        return P, []

    def root(self, t: Trace, P: ArrayRoot, tolerance: Fraction, stored: bool, in_loops: bool) -> Array:
        return self.root_array(t, None if stored else self._as_stored(P))

    def _as_stored(self, P: ArrayRoot) -> Array:
        """A local array that holds P as the field does."""
        P = self._owned(P)
        t, n = P.space.t, self.n
        S = P.space.array("S", n * (n + 1) // 2)
        with t.loop("j", 0, n) as j:
            with t.loop("i", 0, j) as i:
                S[self.spot(t, i, j)] = P.at(i, j)
            S[self.spot(t, j, j)] = P.diagonal(j)
        return S

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> LoopedFactors[ArrayRoot]:
        def finish(space: Space) -> ArrayRoot:
            t.section("roots")
            self._take_roots(space)
            return ArrayRoot(space, self, own=True)

        return LoopedFactors(t, self.absorber, self.order, Q, noise, how, finish)

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: ArrayRoot) -> Symmetric:
        return Symmetric(self.n, lambda i, j: self._entry(P, i, j))

    def _entry(self, P: ArrayRoot, i: int, j: int) -> Value:
        """P_ij, i <= j, summed in a loop."""
        t, last = P.space.t, P.diagonal(j)
        start = last * last if i == j else P.at(i, j) * last
        if j == self.n - 1:
            return start
        total = t.variable(t.unique("total"), start)
        with t.loop("k", j + 1, self.n) as k:
            total.set(total.get() + P.at(i, k) * P.at(j, k))
        value = t.name(total.get(), f"p_{self.names[i]}_{self.names[j]}")
        return assume_nonnegative(value) if i == j else value

    def variance(self, P: ArrayRoot, h: Vector) -> Number:
        t, n, space = P.space.t, self.n, P.space
        first, _ = space.row(h)
        if first == n:
            return 0
        array = space.arrays["h"]
        total = t.variable(t.unique("total"), 0)
        with t.loop("j", first, n) as j:
            f = t.variable("f", array[j] * P.diagonal(j))
            with t.loop("i", first, j) as i:
                f.set(f.get() + P.at(i, j) * array[i])
            value = t.name(f.get(), "f_j")
            total.set(total.get() + value * value)
        return assume_nonnegative(t.name(total.get(), "spread"))

    def inflated(self, P: ArrayRoot, a: Number) -> ArrayRoot:
        P = self._owned(P)
        t = P.space.t
        root = t.name(sqrt(t.value(a)), "root_inflation")
        for array, size in zip(self.absorber.arrays(P.space), (self.n * (self.n - 1) // 2, self.n), strict=True):
            with t.loop("i", 0, size) as i:
                array[i] = array[i] * root
        return P

    def limit(self, t: Trace, P: ArrayRoot, floors: Limits, ceilings: Limits, epsilon: Fraction) -> ArrayRoot:
        """A floor by way of U D U^T, where it is met; a ceiling scales row i down."""
        P = self._owned(P)
        U, D = self.absorber.arrays(P.space)
        n, room = self.n, margin(self.n, epsilon)
        for i, floor in enumerate(floors):
            if floor is not None:
                p = self._entry(P, i, i)
                below = t.name(p < floor * (1 - room), "below")
                t.flag(below, "REGULARIZED")
                self.absorber.columns(P.space)
                with t.when(below):
                    lack = t.name(floor - p, "lack")
                    with t.loop("j", 0, n) as j:
                        d = t.name(D[j], "d")
                        inverse = t.name(reciprocal(assume_nonnegative(d))[1], "inverse")
                        D[j] = d * d
                        with t.loop("k", 0, j) as k:
                            U[strict_start(j) + k] = U[strict_start(j) + k] * inverse
                    self.absorber.absorb_unit(P.space, i, lack)
                    self._take_roots(P.space)
        for i, ceiling in enumerate(ceilings):
            if ceiling is not None:
                p = self._entry(P, i, i)
                above = t.name(p > ceiling * (1 + room), "above")
                t.flag(above, "REGULARIZED")
                with t.when(above):
                    scale = t.name(sqrt(ceiling / p), "scale")
                    D[i] = D[i] * scale
                    with t.loop("j", i + 1, n) as j:
                        U[strict_start(j) + i] = U[strict_start(j) + i] * scale
        return P

    def evidence(self, P: ArrayRoot, after_predict: bool) -> list[Value]:
        return [P.diagonal(j) for j in range(self.n)] if after_predict else []

    def store(self, t: Trace, P: ArrayRoot, names: list[str], after_predict: bool) -> None:
        if not P.own:
            return
        with t.loop("j", 0, self.n) as j:
            with t.loop("i", 0, j) as i:
                t.store("kf.S", self.place(i, j), P.at(i, j))
            t.store("kf.S", self.place(j, j), P.diagonal(j))

    def tolerance(self, P: ArrayRoot, h: Vector) -> int:
        """None: it is a square."""
        return 0

    # mixtures ----------------------------------------------------------------------------------------

    def mixture(
        self, t: Trace, own: Part, others: list[Part], spread: list[tuple[Array, Number]],
        place: Callable[[Value], Value],
    ) -> dict[str, Array]:  # fmt: skip
        """By way of U D U^T, as a prediction."""
        n, space, weight = self.n, Space(t), own.weight
        U, D = self.absorber.arrays(space)
        source = own.element("kf.S")
        with t.loop("j", 0, n) as j:
            d = t.name(source(self.spot(t, j, j)), "d")
            inverse = t.name(reciprocal(assume_nonnegative(d))[1], "inverse")
            D[j] = t.value(times(weight, d * d))
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = 0 if is_zero(weight) else source(self.spot(t, i, j)) * inverse
        for part in others:
            self._add(space, part)
        self.absorber.add_spread(space, spread, place)
        self._take_roots(space)
        return {"kf.S": self._as_stored(ArrayRoot(space, self, own=True))}

    def _add(self, space: Space, part: Part) -> None:
        t, element = space.t, part.element("kf.S")

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k + 1) as i:
                entry(i, element(self.spot(t, i, k)))

        def factor(k: int | Value) -> Value:
            if isinstance(k, int):  # its column is taken as a unit vector
                first = element(self.spot(t, k, k))
                return t.value(times(part.weight, first * first))
            return t.value(part.weight)

        self.absorber.add(space, column_of, factor)
