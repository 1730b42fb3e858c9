"""Covariance kept as U D U^T, in loops: layout `ud` for size, the same fields and the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, is_positive, is_zero
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.base import GainChange
from kfgen.filters.covariance.kernels.absorber import Absorber
from kfgen.filters.covariance.kernels.points import solve
from kfgen.filters.covariance.kernels.updates import bierman
from kfgen.filters.covariance.looped import (
    Column,
    Displacement,
    Given,
    Kernels,
    Space,
    at_rest,
    changed_gain,
    fill,
    integer,
    next_gain,
)
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.ud.straight import UD
from kfgen.filters.frame.runs import Put
from kfgen.filters.frame.triangles import strict, strict_start
from kfgen.ir.trace import Array, Trace, Value


@dataclass(frozen=True)
class Factors:
    """U and D: those of the struct, or the function's own arrays, of which only the last version counts."""

    space: Space
    own: bool

    def u(self, place: int | Value) -> Value:
        return self.space.arrays["factor"][place] if self.own else self.space.t.element("kf.U", place)

    def d(self, place: int | Value) -> Value:
        found = self.space.arrays["diagonal"][place] if self.own else self.space.t.element("kf.D", place)
        assume_nonnegative(found)
        return found


class RolledUD(UD):
    """Layout `ud` in loops. The update by joseph's form is Bierman's and, for a changed gain, a rank-one term."""

    group = 1
    rolled = True

    def __init__(
        self, order: list[int], update: str, change: GainChange | None, names: list[str], kernels: Kernels,
        weighted: bool, steps: bool, table: tuple[str, str],
    ) -> None:  # fmt: skip
        """names: of the states in the inner order. weighted: whether measurements may have a weight. steps:
        whether what each measurement moves the state by is asked for. table: as of Absorber."""
        super().__init__(order, update, change)
        self.group = 1
        self.names = names
        self.kernels = kernels
        self.weighted = weighted
        self.steps = steps
        self.absorber = Absorber(names, kernels, table)

    @property
    def tables(self) -> Mapping[str, tuple[int, ...]]:  # type: ignore[override]
        return self.absorber.tables

    def load(self, t: Trace) -> Factors:  # type: ignore[override]
        return Factors(Space(t), own=False)

    def _owned(self, P: Factors) -> Factors:
        """P in arrays that may be changed."""
        if P.own:
            return P
        t, n, space = P.space.t, self.n, P.space
        U, D = self.absorber.arrays(space)
        with t.loop("i", 0, n * (n - 1) // 2) as i:
            U[i] = t.element("kf.U", i)
        with t.loop("i", 0, n) as i:
            D[i] = t.element("kf.D", i)
        return Factors(space, own=True)

    # predict -----------------------------------------------------------------------------------------

    def predict(self, t: Trace, P: Factors, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]  # type: ignore[override]
                ) -> Factors:  # fmt: skip
        """F U D U^T F^T + Q + sum of d w w^T."""

        def weight(k: int | Value) -> Value:
            return t.element("kf.D", k)

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k) as i:
                entry(i, t.element("kf.U", strict_start(k) + i))
            entry(k, t.one)

        title = "F U D U^T F^T + Q, two columns of F U after another"
        self.absorber.run(P.space, F, Q, noise, title, column_of, weight)
        return Factors(P.space, own=True)

    # update ------------------------------------------------------------------------------------------

    def update(self, t: Trace, P: Factors, measurements: list[Measurement]  # type: ignore[override]
               ) -> tuple[Factors, Rows, Vector]:  # fmt: skip
        (measurement,) = measurements
        n, space = self.n, P.space
        P = self._owned(P)
        U, D = self.absorber.arrays(space)
        moves = self.change is None and not self.steps
        if not moves:
            applied = next_gain(space, "gain", n, measurement.moved, self.steps)
        if moves and not isinstance(measurement.moved, Displacement):
            at_rest(space, n)
        s = space.array("s", 2)
        seen = [i for i, x in enumerate(measurement.h) if not is_zero(x)]
        function = bierman(self.kernels, n, len(seen) == 1, is_positive(measurement.r), self.weighted, moves)
        row: list[Given]
        if len(seen) == 1:
            row = [integer(t, seen[0]), t.value(measurement.h[seen[0]])]
        else:
            first, last = space.row(measurement.h)
            row = [("h", 0), integer(t, first), integer(t, last)]
        row.append(t.value(measurement.r))
        weight = [t.value(measurement.g)] if self.weighted else []
        gain: list[Given] = [t.value(measurement.nu), ("moved", 0)] if moves else [(applied.name, 0)]
        t.call(function, [(U.name, 0), (D.name, 0), *row, *weight, *gain, (s.name, 0)])
        variance = t.name(s[0], "variance")
        if moves:
            return P, [Displacement(space, n, space.arrays["moved"], [], s[1])], [variance]
        if self.change is not None:
            t.section("the gain that is applied differs from K by w: + s w w^T")
            w = self.absorber.columns(space)
            changed_gain(t, self.change, applied, w, n)
            added = t.value(linalg.times(measurement.g, variance))
            self.absorber.absorb(space, False, [added, t.zero], integer(t, n))
        return P, [Column(space, applied, n)], [variance]

    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        self.absorber.learn(moved.space, field, rate, sure, moved.terms)

    def downdated(  # type: ignore[override]
        self, t: Trace, P: Factors, c: Vector, s: Number, tolerance: Fraction, sure: bool, prior: Factors
    ) -> tuple[Factors, Value]:
        P = self._owned(P)
        array = P.space.array("c", self.n)
        fill(t, array, c)
        known = None if sure else tolerance
        # the points' rounding is in c
        return P, self.absorber.remove(P.space, array, t.value(s), 1024 * tolerance, known)

    def solved(self, t: Trace, name: str, c: Vector, tolerance: Fraction) -> Vector:
        """P^-1 c of the struct's P, in a local array."""
        array = t.array(name, self.n)
        fill(t, array, c)
        t.call(solve(self.kernels, self.n), [("kf.U", 0), ("kf.D", 0), (array.name, 0), t.value(tolerance)])
        return [array[i] for i in range(self.n)]

    def placed(self, P: Factors) -> dict[str, Array]:
        """Local arrays that hold P as the fields of the struct do."""
        U, D = self.absorber.arrays(self._owned(P).space)
        return {"kf.U": U, "kf.D": D}

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: Factors) -> Symmetric:  # type: ignore[override]
        return Symmetric(self.n, lambda i, j: self._entry(P, i, j))

    def _entry(self, P: Factors, i: int, j: int) -> Value:
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

    def variance(self, P: Factors, h: Vector) -> Number:  # type: ignore[override]
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

    def inflated(self, P: Factors, a: Number) -> Factors:  # type: ignore[override]
        P = self._owned(P)
        t, D = P.space.t, P.space.arrays["diagonal"]
        with t.loop("i", 0, self.n) as i:
            D[i] = D[i] * t.value(a)
        return P

    def limit(  # type: ignore[override]
        self, t: Trace, P: Factors, floors: list[Fraction | None], ceilings: list[Fraction | None]
    ) -> Factors:
        P = self._owned(P)
        array = P.space.arrays["diagonal"]
        D: Vector = [t.name(array[j], f"d_{name}") for j, name in enumerate(self.names)]
        limited = super().limit(t, ([], list(D)), floors, ceilings)[1]
        for j, (new, old) in enumerate(zip(limited, D, strict=True)):
            if new is not old:
                array[j] = new
        return P

    def evidence(self, P: Factors, after_predict: bool) -> list[Value]:  # type: ignore[override]
        if not (after_predict or self.form == "joseph"):
            return []
        return [P.d(j) for j in range(self.n)]

    def store(self, t: Trace, P: Factors, names: list[str], after_predict: bool) -> None:  # type: ignore[override]
        n = self.n
        if not P.own:
            return
        with t.loop("i", 0, n * (n - 1) // 2) as i:
            t.store("kf.U", i, P.u(i))
        with t.loop("i", 0, n) as i:
            t.store("kf.D", i, P.d(i))
