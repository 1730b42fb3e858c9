"""Covariance kept as its lower Cholesky factor, in loops: layout `sqrt` for size, the same field, the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, constant_root, is_positive, select, sqrt
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.kernels.absorber import Absorber
from kfgen.filters.covariance.kernels.points import remove_root
from kfgen.filters.covariance.kernels.updates import carlson
from kfgen.filters.covariance.looped import (
    Column,
    Displacement,
    Given,
    Kernels,
    Space,
    at_rest,
    fill,
    integer,
    next_gain,
)
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.sqrt.straight import Sqrt
from kfgen.filters.frame.runs import Put
from kfgen.filters.frame.triangles import strict, strict_start
from kfgen.ir.trace import Array, Trace, Value


@dataclass(frozen=True)
class Root:
    """S, upper triangular in the inner order: that of the struct, or in the function's own arrays, of which only the
    last version counts: `factor` above the diagonal, `diagonal`."""

    space: Space
    own: bool


class RolledSqrt(Sqrt):
    """Layout `sqrt` in loops."""

    rolled = True

    def __init__(
        self, n: int, names: list[str], kernels: Kernels, weighted: bool, steps: bool, table: tuple[str, str]
    ) -> None:
        """As of RolledUD."""
        super().__init__(n)
        self.names = names
        self.kernels = kernels
        self.weighted = weighted
        self.steps = steps
        self.absorber = Absorber(names, kernels, table)

    @property
    def tables(self) -> Mapping[str, tuple[int, ...]]:  # type: ignore[override]
        return self.absorber.tables

    def load(self, t: Trace) -> Root:  # type: ignore[override]
        return Root(Space(t), own=False)

    def _at(self, P: Root, i: int | Value, j: int | Value) -> Value:
        """S_ij, i < j."""
        t = P.space.t
        if P.own:
            return P.space.arrays["factor"][(strict_start(j) if isinstance(j, Value) else strict(0, j)) + i]
        return t.element("kf.S", self.spot(t, i, j))

    def _diagonal(self, P: Root, j: int | Value) -> Value:
        """S_jj."""
        t = P.space.t
        return P.space.arrays["diagonal"][j] if P.own else t.element("kf.S", self.spot(t, j, j))

    def spot(self, t: Trace, i: int | Value, j: int | Value) -> int | Value:
        """Where S_ij stands in kf.S, i <= j."""
        if isinstance(i, int) and isinstance(j, int):
            return self.packed(i, j)
        return self._place(integer(t, i) if isinstance(i, int) else i, integer(t, j) if isinstance(j, int) else j)

    def _owned(self, P: Root) -> Root:
        """S in arrays that may be changed."""
        if P.own:
            return P
        t = P.space.t
        U, D = self.absorber.arrays(P.space)
        with t.loop("j", 0, self.n) as j:
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = self._at(P, i, j)
            D[j] = self._diagonal(P, j)
        return Root(P.space, own=True)

    def predict(self, t: Trace, P: Root, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]  # type: ignore[override]
                ) -> Root:  # fmt: skip
        """S S^T <- F S S^T F^T + Q + sum of d w w^T: U D U^T first, one root per state at the end."""

        def weight(k: int | Value) -> Value:
            if k == 0 and isinstance(k, int):  # its column is taken as a unit vector
                first = self._diagonal(P, 0)
                return first * first
            return t.one

        def column_of(k: Value, entry: Put) -> None:
            with t.loop("i", 0, k + 1) as i:
                entry(i, self._at(P, i, k))

        self.absorber.run(P.space, F, Q, noise, "F S S^T F^T + Q, two columns of F S after another", column_of, weight)
        t.section("roots")
        self.take_roots(P.space)
        return Root(P.space, own=True)

    def take_roots(self, space: Space) -> None:
        """From U D U^T in the arrays of the absorber to S S^T."""
        t = space.t
        U, D = self.absorber.arrays(space)
        with t.loop("j", 0, self.n) as j:
            root = t.name(sqrt(assume_nonnegative(D[j])), "root")
            D[j] = root
            with t.loop("i", 0, j) as i:
                U[strict_start(j) + i] = U[strict_start(j) + i] * root

    def update(self, t: Trace, P: Root, measurements: list[Measurement]  # type: ignore[override]
               ) -> tuple[Root, Rows, Vector]:  # fmt: skip
        (measurement,) = measurements
        n, space = self.n, P.space
        P = self._owned(P)
        U, D = self.absorber.arrays(space)
        moves = not self.steps
        if not moves:
            applied = next_gain(space, "gain", n, measurement.moved, self.steps)
        elif not isinstance(measurement.moved, Displacement):
            at_rest(space, n)
        s = space.array("s", 2)
        first, last = space.row(measurement.h)
        function = carlson(self.kernels, n, is_positive(measurement.r), self.weighted, moves)
        row: list[Given] = [("h", 0), integer(t, first), integer(t, last), t.value(measurement.r)]
        weight = [t.value(measurement.g)] if self.weighted else []
        gain: list[Given] = [t.value(measurement.nu), ("moved", 0)] if moves else [(applied.name, 0)]
        t.call(function, [(U.name, 0), (D.name, 0), *row, *weight, *gain, (s.name, 0)])
        variance = t.name(s[0], "variance")
        if moves:
            return P, [Displacement(space, n, space.arrays["moved"], [], s[1])], [variance]
        return P, [Column(space, applied, n)], [variance]

    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        self.absorber.learn(moved.space, field, rate, sure, moved.terms)

    def downdated(  # type: ignore[override]
        self, t: Trace, P: Root, c: Vector, s: Number, tolerance: Fraction, sure: bool, prior: Root
    ) -> tuple[Root, Value]:
        n, space = self.n, P.space
        if "small" not in space.arrays:
            small = space.array("small", n)
            with t.loop("j", 0, n) as j:
                last = t.name(self._diagonal(prior, j), "last")
                total = t.variable("total", last * last)
                with t.loop("k", j + 1, n) as k:
                    s_jk = t.name(self._at(prior, j, k), "s_jk")
                    total.set(total.get() + s_jk * s_jk)
                small[j] = total.get() * (tolerance * tolerance)
        P = self._owned(P)
        array, told = space.array("c", n), space.array("told", 2)
        fill(t, array, c)
        arrays: list[Given] = [(each.name, 0) for each in (*self.absorber.arrays(space), array, space.arrays["small"])]
        t.call(remove_root(self.kernels, n), [*arrays, t.value(s), t.value(tolerance), (told.name, 0)])
        t.flag(told[1] > 0, "REGULARIZED")
        return P, told[0] > 0

    def placed(self, P: Root) -> dict[str, Array]:
        """A local array that holds P as the field of the struct does."""
        P = self._owned(P)
        t, n = P.space.t, self.n
        S = P.space.array("S", n * (n + 1) // 2)
        with t.loop("j", 0, n) as j:
            with t.loop("i", 0, j) as i:
                S[self.spot(t, i, j)] = self._at(P, i, j)
            S[self.spot(t, j, j)] = self._diagonal(P, j)
        return {"kf.S": S}

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: Root) -> Symmetric:  # type: ignore[override]
        return Symmetric(self.n, lambda i, j: self._entry(P, i, j))

    def _entry(self, P: Root, i: int, j: int) -> Value:
        """P_ij, i <= j, summed in a loop."""
        t, last = P.space.t, self._diagonal(P, j)
        start = last * last if i == j else self._at(P, i, j) * last
        if j == self.n - 1:
            return start
        total = t.variable(t.unique("total"), start)
        with t.loop("k", j + 1, self.n) as k:
            total.set(total.get() + self._at(P, i, k) * self._at(P, j, k))
        value = t.name(total.get(), f"p_{self.names[i]}_{self.names[j]}")
        return assume_nonnegative(value) if i == j else value

    def variance(self, P: Root, h: Vector) -> Number:  # type: ignore[override]
        t, n, space = P.space.t, self.n, P.space
        first, _ = space.row(h)
        if first == n:
            return 0
        array = space.arrays["h"]
        total = t.variable(t.unique("total"), 0)
        with t.loop("j", first, n) as j:
            f = t.variable("f", array[j] * self._diagonal(P, j))
            with t.loop("i", first, j) as i:
                f.set(f.get() + self._at(P, i, j) * array[i])
            value = t.name(f.get(), "f_j")
            total.set(total.get() + value * value)
        return assume_nonnegative(t.name(total.get(), "spread"))

    def inflated(self, P: Root, a: Number) -> Root:  # type: ignore[override]
        P = self._owned(P)
        t = P.space.t
        root = t.name(sqrt(t.value(a)), "root_inflation")
        for array, size in zip(self.absorber.arrays(P.space), (self.n * (self.n - 1) // 2, self.n), strict=True):
            with t.loop("i", 0, size) as i:
                array[i] = array[i] * root
        return P

    def limit(  # type: ignore[override]
        self, t: Trace, P: Root, floors: list[Fraction | None], ceilings: list[Fraction | None]
    ) -> Root:
        """variance_floor raises S_ii^2; variance_ceiling scales row i down."""
        P = self._owned(P)
        U, D = self.absorber.arrays(P.space)
        for i, (low, high) in enumerate(zip(floors, ceilings, strict=True)):
            if low is not None:
                edge = constant_root(low)
                own = t.name(D[i], f"s_{self.names[i]}")
                t.flag(own < edge, "REGULARIZED")
                D[i] = select(own < edge, t.value(edge), own)
            if high is not None:
                edge = constant_root(high)
                own = t.name(D[i], f"s_{self.names[i]}")
                t.flag(own > edge, "REGULARIZED")
                scale = t.name(select(own > edge, edge / own, 1), "scale")
                D[i] = own * scale
                with t.loop("j", i + 1, self.n) as j:
                    U[strict_start(j) + i] = U[strict_start(j) + i] * scale
        return P

    def evidence(self, P: Root, after_predict: bool) -> list[Value]:  # type: ignore[override]
        return [self._diagonal(P, j) for j in range(self.n)] if after_predict else []

    def store(self, t: Trace, P: Root, names: list[str], after_predict: bool) -> None:  # type: ignore[override]
        if not P.own:
            return
        with t.loop("j", 0, self.n) as j:
            with t.loop("i", 0, j) as i:
                t.store("kf.S", self._place(i, j), self._at(P, i, j))
            t.store("kf.S", self._place(j, j), self._diagonal(P, j))
