"""U D U^T in loops: for size; the same fields and the same numbers."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra.limits import Limits, margin
from kfgen.filters.algebra.linalg import Rows, Vector, times
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_positive, is_zero, sqrt
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.algebra.triangles import strict, strict_size, strict_start
from kfgen.filters.covariance.kernels.function import Passed, integer
from kfgen.filters.covariance.kernels.points import solve
from kfgen.filters.covariance.kernels.updates import bierman
from kfgen.filters.covariance.loops.by_factors import ByFactors
from kfgen.filters.covariance.loops.gather import LoopedFactors
from kfgen.filters.covariance.loops.looped import Looping
from kfgen.filters.covariance.loops.motion import (
    AppliedGain,
    ArrayGain,
    Displacement,
    changed_gain,
)
from kfgen.filters.covariance.loops.space import Space, fill
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Gatherer, Gathering, Part, Removal, Scalar
from kfgen.filters.covariance.ud.store import UDStore
from kfgen.filters.covariance.ud.straight import StraightUD
from kfgen.filters.frame.runs import Put
from kfgen.ir.trace import Array, Trace, Value


@dataclass(frozen=True)
class ArrayFactors:
    """U and D: those of the struct, or the function's own arrays, of which only the last version counts."""

    space: Space
    own: bool

    def u(self, place: int | Value) -> Value:
        return self.space.arrays["factor"][place] if self.own else self.space.t.element("kf.U", place)

    def d(self, place: int | Value) -> Value:
        found = self.space.arrays["diagonal"][place] if self.own else self.space.t.element("kf.D", place)
        assume_nonnegative(found)
        return found


class LoopedUD(ByFactors, UDStore):
    """The update by joseph's form is Bierman's and, for a changed gain, a rank-one term."""

    def __init__(self, sibling: StraightUD, how: Looping) -> None:
        ByFactors.__init__(self, sibling, how)
        UDStore.__init__(self, sibling.order)
        self.form = sibling.form
        self.change = sibling.change

    def plain(self) -> LoopedUD:
        if self.change is None:
            return self
        other = copy(self)
        other.change = None
        return other

    def load(self, t: Trace) -> ArrayFactors:
        return ArrayFactors(Space(t), own=False)

    def _owned(self, P: ArrayFactors) -> ArrayFactors:
        """P in arrays that may be changed."""
        if P.own:
            return P
        t, n, space = P.space.t, self.n, P.space
        U, D = self.absorber.arrays(space)
        with t.loop("i", 0, strict_size(n)) as i:
            U[i] = t.element("kf.U", i)
        with t.loop("i", 0, n) as i:
            D[i] = t.element("kf.D", i)
        return ArrayFactors(space, own=True)

    # steps -------------------------------------------------------------------------------------------

    def predict(
        self, t: Trace, P: ArrayFactors, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]
    ) -> ArrayFactors:
        def weight(k: int | Value) -> Value:
            return t.element("kf.D", k)

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k) as i:
                entry(i, t.element("kf.U", strict_start(k) + i))
            entry(k, t.one)

        title = "F U D U^T F^T + Q, two columns of F U after another"
        self.absorber.run(P.space, F, Q, noise, title, column_of, weight)
        return ArrayFactors(P.space, own=True)

    def update(
        self, t: Trace, P: ArrayFactors, measurements: list[Scalar], motion: Displacement
    ) -> tuple[ArrayFactors, list[AppliedGain | ArrayGain]]:
        (scalar,) = measurements
        measurement, moves = scalar.measurement, self.change is None and not self.steps
        P = self._owned(P)
        space = P.space
        seen = [i for i, x in enumerate(measurement.h) if not is_zero(x)]
        function = bierman(self.kernels, self.n, len(seen) == 1, is_positive(measurement.r), self.weighted, moves)

        def row() -> list[Passed]:
            if len(seen) == 1:
                return [integer(t, seen[0]), t.value(measurement.h[seen[0]])]
            first, last = space.row(measurement.h)
            return [("h", 0), integer(t, first), integer(t, last)]

        gain = self.measured(space, scalar, motion, moves, function, row)
        if self.change is not None:
            assert isinstance(gain, ArrayGain)
            t.section("the gain that is applied differs from K by w: + s w w^T")
            w = self.absorber.columns(space)
            changed_gain(t, self.change, gain.array, w, self.n)
            added = t.value(times(measurement.g, gain.s))
            self.absorber.absorb(space, False, [added, t.zero], integer(t, self.n))
        return P, [gain]

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: ArrayFactors) -> Symmetric:
        return Symmetric(self.n, lambda i, j: self._entry(P, i, j))

    def _entry(self, P: ArrayFactors, i: int, j: int) -> Value:
        """P_ij, i <= j, summed in a loop."""
        t, n = P.space.t, self.n
        start = P.d(j) if i == j else P.d(j) * P.u(strict(i, j))
        if j == n - 1:
            return start
        total = t.variable(t.unique("total"), start)
        with t.loop("k", j + 1, n) as k:
            u = P.u(strict_start(k) + i) * P.d(k)
            total.set(total.get() + u * P.u(strict_start(k) + j))
        value = t.name(total.get(), f"p_{self.names[i]}_{self.names[j]}")
        return assume_nonnegative(value) if i == j else value

    def variance(self, P: ArrayFactors, h: Vector) -> Number:
        t, n, space = P.space.t, self.n, P.space
        first, _ = space.row(h)
        if first == n:
            return 0
        array = space.arrays["h"]
        total = t.variable(t.unique("total"), 0)
        with t.loop("j", first, n) as j:
            f = t.variable("f", array[j])
            with t.loop("i", first, j) as i:
                f.set(f.get() + P.u(strict_start(j) + i) * array[i])
            v = t.name(f.get(), "f_j")
            total.set(total.get() + v * v * P.d(j))
        return assume_nonnegative(t.name(total.get(), "spread"))

    def inflated(self, P: ArrayFactors, a: Number) -> ArrayFactors:
        P = self._owned(P)
        t, D = P.space.t, P.space.arrays["diagonal"]
        with t.loop("i", 0, self.n) as i:
            D[i] = D[i] * t.value(a)
        return P

    def tolerance(self, P: ArrayFactors, h: Vector) -> int:
        """None: a sum of D_j f_j^2 is not negative."""
        return 0

    def limit(self, t: Trace, P: ArrayFactors, floors: Limits, ceilings: Limits, epsilon: Fraction) -> ArrayFactors:
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
                    self.absorber.absorb_unit(P.space, i, floor - p)
        for i, ceiling in enumerate(ceilings):
            if ceiling is not None:
                p = self._entry(P, i, i)
                above = t.name(p > ceiling * (1 + room), "above")
                t.flag(above, "REGULARIZED")
                with t.when(above):
                    square = t.name(ceiling / p, "square")
                    scale = t.name(sqrt(square), "scale")
                    D[i] = D[i] * square
                    with t.loop("k", 0, i) as k:
                        U[strict(0, i) + k] = U[strict(0, i) + k] * (1 / scale)
                    with t.loop("j", i + 1, n) as j:
                        U[strict_start(j) + i] = U[strict_start(j) + i] * scale
        return P

    def evidence(self, P: ArrayFactors, after_predict: bool) -> list[Value]:
        if not (after_predict or self.form == "joseph"):
            return []
        return [P.d(j) for j in range(self.n)]

    def store(self, t: Trace, P: ArrayFactors, names: list[str], after_predict: bool) -> None:
        n = self.n
        if not P.own:
            return
        with t.loop("i", 0, strict_size(n)) as i:
            t.store("kf.U", i, P.u(i))
        with t.loop("i", 0, n) as i:
            t.store("kf.D", i, P.d(i))

    # sigma points ------------------------------------------------------------------------------------

    def root(self, t: Trace, P: ArrayFactors, tolerance: Fraction, stored: bool, in_loops: bool) -> Array:
        if stored:
            return self.root_array(t)
        U, D = self.absorber.arrays(self._owned(P).space)
        return self.root_array(t, {"kf.U": U, "kf.D": D})

    def gatherer(
        self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering
    ) -> Gatherer[ArrayFactors]:
        return LoopedFactors(t, self.absorber, self.order, Q, noise, how, lambda space: ArrayFactors(space, own=True))

    def downdated(
        self, t: Trace, P: ArrayFactors, c: Vector, s: Number, how: Removal, prior: ArrayFactors
    ) -> tuple[ArrayFactors, Value]:
        P = self._owned(P)
        array = P.space.array("c", self.n)
        fill(t, array, c)
        known = None if how.sure else how.tolerance
        # the points' rounding is in c
        return P, self.absorber.remove(P.space, array, t.value(s), 1024 * how.tolerance, known)

    def indefinite(self, P: ArrayFactors, tolerance: Fraction) -> tuple[ArrayFactors, list[Value]]:
        """Never: D is not negative."""
        return P, []

    def solved(self, t: Trace, P: ArrayFactors, columns: list[Vector], tolerance: Fraction) -> Rows:
        """P: as it stands in the struct. The rows are in local arrays."""
        out: Rows = []
        for a, c in enumerate(columns):
            array = t.array(f"h_{a}", self.n)
            fill(t, array, c)
            t.call(solve(self.kernels, self.n), [("kf.U", 0), ("kf.D", 0), (array.name, 0), t.value(tolerance)])
            out.append([array[i] for i in range(self.n)])
        return out

    # mixtures ----------------------------------------------------------------------------------------

    def mixture(
        self, t: Trace, own: Part, others: list[Part], spread: list[tuple[Array, Number]],
        place: Callable[[Value], Value],
    ) -> dict[str, Array]:  # fmt: skip
        n, space = self.n, Space(t)
        U, D = self.absorber.arrays(space)
        u, d = own.element("kf.U"), own.element("kf.D")
        with t.loop("i", 0, strict_size(n)) as i:
            U[i] = 0 if is_zero(own.weight) else u(i)
        with t.loop("i", 0, n) as i:
            D[i] = t.value(times(own.weight, d(i)))
        for part in others:
            self._add(space, part)
        self.absorber.add_spread(space, spread, place)
        return {"kf.U": U, "kf.D": D}

    def _add(self, space: Space, part: Part) -> None:
        t, upper, diagonal = space.t, part.element("kf.U"), part.element("kf.D")

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k) as i:
                entry(i, upper(strict_start(k) + i))
            entry(k, t.one)

        def factor(k: int | Value) -> Value:
            return t.value(times(part.weight, assume_nonnegative(diagonal(k))))

        self.absorber.add(space, column_of, factor)
