"""Covariance kept as the upper triangle of P, in loops: layout `full` for size, the same field, the same numbers."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, is_constant, is_one, is_positive, is_zero, reciprocal, select, sqrt
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import Block
from kfgen.filters.covariance.full.straight import Full
from kfgen.filters.covariance.full.terms import Entries, Term
from kfgen.filters.covariance.kernels.updates import add_terms, put_row, take_row
from kfgen.filters.covariance.looped import (
    Column,
    Displacement,
    Given,
    Kernels,
    Space,
    changed_gain,
    fill,
    integer,
    next_gain,
)
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.frame.runs import Put, put
from kfgen.filters.frame.triangles import upper, upper_start
from kfgen.ir.trace import Array, Trace, Value

PENDING = 4  # measurements that are taken together, in one pass over P


class RolledFull(Full):
    """Layout `full` in loops. Standard updates gather their terms and write P once; Joseph's change a copy of P."""

    rolled = True

    def __init__(self, full: Full, names: list[str], kernels: Kernels, steps: bool) -> None:
        """steps: as of RolledUD."""
        super().__init__(full.n, full.form, full.epsilon, full.sequence, full.change)
        self.names = names
        self.kernels = kernels
        self.steps = steps

    def blocks(self, P0: list[list[Fraction]]) -> list[Block]:
        return [replace(block, compact=True) for block in super().blocks(P0)]

    def load(self, t: Trace) -> Entries:  # type: ignore[override]
        return Entries(Space(t))

    # predict -----------------------------------------------------------------------------------------

    def predict(self, t: Trace, P: Entries, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]  # type: ignore[override]
                ) -> Entries:  # fmt: skip
        """P <- F P on the columns of a square array, then, of its transpose, again."""
        n, space = self.n, P.space
        additive = Q.entries()
        a = space.array("product", n * n)
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            value = t.name(P.at(n, i, j), "value")
            a[j * n + i] = value
            a[i * n + j] = value
        t.section("F P F^T: F times every column of P, and again of the transpose")
        with t.loop("side", 0, 2) as side:
            with t.loop("k", 0, n) as k:
                start = k * n
                old = [t.name(a[start + m], f"p_{name}") for m, name in enumerate(self.names)]
                for m, row in enumerate(F):
                    if not (is_one(row[m]) and all(is_zero(x) for other, x in enumerate(row) if other != m)):
                        a[start + m] = t.value(linalg.dot(row, list(old)))
            with t.when(side < 1), t.loop("j", 1, n) as j, t.loop("i", 0, j) as i:
                value = t.name(a[j * n + i], "value")
                a[j * n + i] = a[i * n + j]
                a[i * n + j] = value
        t.section("+ Q")
        self.add_noise(t, a, additive, noise, square=True)
        return Entries(space, a.name, square=True)

    def add_noise(self, t: Trace, a: Array, Q: Rows, noise: list[tuple[Vector, Value]], square: bool) -> None:
        """Q and d w w^T, entry by entry where they are sparse, the upper triangle of a square or a packed array."""
        n = self.n
        sparse: dict[tuple[int, int], Value] = {}
        kept = self._kept(Q)
        for row in range(n):
            for col in range(row, n):
                total: Number = 0 if kept else Q[row][col]
                for w, d in noise:
                    total = linalg.plus(total, linalg.times(linalg.times(w[row], d), w[col]))
                if not is_zero(total):
                    sparse[row, col] = t.value(total)
        if kept:
            with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
                spot = j * n + i if square else upper_start(j) + i
                a[spot] = a[spot] + t.element(kept, upper_start(j) + i)

        def add(i: int | Value, value: Value) -> None:
            at = i * (n + 1) if square else upper(0, i) + i if isinstance(i, int) else upper_start(i) + i
            a[at] = a[at] + value

        put(t, add, {row: v for (row, col), v in sparse.items() if row == col})
        for (row, col), value in sparse.items():
            if row != col:
                at = col * n + row if square else upper(row, col)
                a[at] = a[at] + value

    def _kept(self, Q: Rows) -> str:
        """The field that holds all of Q, packed as P is; empty: none."""
        node = Q[0][0].node if isinstance(Q[0][0], Value) else None
        if node is None or node.op != "element":
            return ""
        for j in range(self.n):
            for i in range(j + 1):
                other = Q[i][j].node if isinstance(Q[i][j], Value) else None
                if other is None or other.op != "element" or other.data != node.data:
                    return ""
                if other.args[0].constant != upper(i, j):
                    return ""
        return str(node.data)

    # update ------------------------------------------------------------------------------------------

    def update(self, t: Trace, P: Entries, measurements: list[Measurement]  # type: ignore[override]
               ) -> tuple[Entries, Rows, Vector]:  # fmt: skip
        (measurement,) = measurements
        if self.form == "joseph":
            P, gain, s = self._joseph(t, P, measurement)
        else:
            P, gain, s = self._standard(t, P, measurement)
        if not is_positive(measurement.r):
            P = self._not_negative(P, measurement, gain)
        return P, [gain], [s]

    def _standard(self, t: Trace, P: Entries, measurement: Measurement) -> tuple[Entries, Column, Value]:
        """P - g K s K^T, put off: one more term."""
        if len(P.terms) == PENDING:
            P = self.written(P)
        space, h, r, g = P.space, measurement.h, measurement.r, measurement.g
        number = len(P.terms)
        c = next_gain(space, f"c{number}", self.n, measurement.moved, self.steps)
        seen = [i for i, x in enumerate(h) if not is_zero(x)]
        self._times(P, h, seen, c)
        s = t.value(linalg.plus(linalg.times(g, linalg.dot([h[i] for i in seen], [c[i] for i in seen])), r))
        inverse = t.name(1 / s if is_positive(r) else reciprocal(s)[1], "inverse_s")
        weight = t.name(t.value(linalg.times(g, inverse)), "weight")
        state: int | None = None
        share: Value | None = None
        if len(seen) == 1 and is_constant(h[seen[0]]):
            state = seen[0]
            share = t.name(t.value(linalg.times(r if is_one(h[state]) else r / h[state], inverse)), "share")
        P = replace(P, terms=(*P.terms, Term(c, weight, state, share)))
        return P, Column(space, c, self.n, inverse), s

    def _times(self, P: Entries, h: Vector, seen: list[int], c: Array) -> None:
        """c = P h^T."""
        t, n, space = P.space.t, self.n, P.space
        factors: dict[int, Value] = {}  # of the terms, what is added and what is taken away
        removed: dict[int, Value] = {}
        fresh = []
        for i in seen:
            start = P.start(i)
            if start < 0:
                fresh.append(i)
            for k, term in enumerate(P.terms):
                if k == start:
                    assert term.share is not None
                    factors[k] = t.value(linalg.plus(factors.get(k, 0), linalg.times(h[i], term.share)))
                elif k > start:
                    part = linalg.times(linalg.times(h[i], term.weight), term.c[i])
                    removed[k] = t.value(linalg.plus(removed.get(k, 0), part))
        factors = {k: t.name(f, "factor") for k, f in factors.items()}
        removed = {k: t.name(f, "factor") for k, f in removed.items()}
        row = c
        for number, i in enumerate(fresh):
            if number:
                row = space.array("row", n)
            t.call(take_row(self.kernels, n), [(P.array or "kf.P", 0), integer(t, i), (row.name, 0)])
            if number or not is_one(h[i]):
                part = t.name(t.value(h[i]), "h_i")
                with t.loop("i", 0, n) as at:
                    scaled = linalg.times(part, row[at])
                    c[at] = linalg.plus(c[at], scaled) if number else scaled
        if factors or removed:
            with t.loop("i", 0, n) as at:
                total: Number = c[at] if fresh else 0
                for k, factor in factors.items():
                    total = linalg.plus(total, linalg.times(factor, P.terms[k].c[at]))
                for k, factor in removed.items():
                    total = linalg.minus(total, linalg.times(factor, P.terms[k].c[at]))
                c[at] = total
        for state in sorted({term.state for term in P.terms if term.state is not None}):
            entries = [self._entry(P, min(i, state), max(i, state)) for i in seen]
            c[state] = t.value(linalg.dot([h[i] for i in seen], entries))

    def _joseph(self, t: Trace, P: Entries, measurement: Measurement) -> tuple[Entries, Column, Value]:
        """A = P - g K h P, then A - g (A h^T - r K) K^T, for any gain, in a copy of P."""
        P = self.written(P)
        n, space = self.n, P.space
        h, r, g = measurement.h, measurement.r, measurement.g
        seen = [i for i, x in enumerate(h) if not is_zero(x)]
        c, rest = space.array("c0", n), space.array("rest", n)
        gain = next_gain(space, "gain", n, measurement.moved, self.steps)
        self._times(P, h, seen, c)
        s = t.value(linalg.plus(linalg.times(g, linalg.dot([h[i] for i in seen], [c[i] for i in seen])), r))
        t.name(s, "s")
        inverse = t.name(1 / s if is_positive(r) else reciprocal(s)[1], "inverse_s")
        with t.loop("i", 0, n) as i:
            gain[i] = c[i] * inverse
        if self.change is not None:
            changed_gain(t, self.change, gain, None, n)
        weighted = gain
        if not is_one(g):
            weighted = space.array("weighted", n)
            with t.loop("i", 0, n) as i:
                weighted[i] = gain[i] * t.value(g)
        for number, state in enumerate(seen):
            row, factor = c, t.name(t.value(h[state]), "h_of_state")
            if not (len(seen) == 1 and is_one(factor)):
                row = space.array("row", n)
                t.call(take_row(self.kernels, n), [(P.array, 0), integer(t, state), (row.name, 0)])
            seen_by = t.name(c[state], "c_of_state")
            with t.loop("i", 0, n) as i:
                partial = t.name(row[i] - weighted[i] * seen_by, "partial")
                before = linalg.times(r, gain[i]) if number == 0 else rest[i]
                rest[i] = t.value(linalg.minus(before, linalg.times(factor, partial)))
        if not seen:
            return P, Column(space, gain, n), s
        t.call(add_terms(self.kernels, n), [(P.array, 0), (c.name, 0), (weighted.name, 0), (rest.name, 0)])
        exact = len(seen) == 1 and is_constant(h[seen[0]]) and is_zero(r) and is_one(g) and self.change is None
        if exact:  # known exactly, not up to rounding
            t.call(put_row(self.kernels, n), [(P.array, 0), integer(t, seen[0]), (rest.name, 0), t.zero])
        return P, Column(space, gain, n), s

    def _not_negative(self, P: Entries, measurement: Measurement, gain: Column) -> Entries:
        """A variance that an exact measurement took to zero may come out below it by round-off: back to zero."""
        c = P.terms[-1].c if self.form == "standard" else P.space.arrays["c0"]
        P = self.written(P)
        t, array = P.space.t, Array(P.space.t, P.array)
        g = t.value(measurement.g)
        with t.loop("i", 0, self.n) as i:
            place = upper_start(i) + i
            variance = t.name(array[place], "variance")
            k = gain.array[i] if gain.factor is None else gain.array[i] * gain.factor
            old = variance + linalg.times(g, k) * c[i]
            low = t.name((variance < 0) & (variance >= -(old * (4 * self.n * self.epsilon))), "negative")
            t.flag(low, "REGULARIZED")
            array[place] = select(low, 0, variance)
        return P

    def learn(self, moved: Displacement, field: str, rate: Fraction, sure: bool) -> None:
        t, n = moved.space.t, self.n
        with t.loop("j", 0, n) as j:
            parts = [t.name(gain[j] * step * step * rate, "part") for gain, step in moved.terms]
            with t.loop("i", 0, j + 1) as i:
                total = t.element(field, upper_start(j) + i) * (1 - rate)
                for (gain, _), part in zip(moved.terms, parts, strict=True):
                    total = total + gain[i] * part
                t.store(field, upper_start(j) + i, total)

    # sigma points -----------------------------------------------------------------------------------

    def downdated(  # type: ignore[override]
        self, t: Trace, P: Entries, c: Vector, s: Number, tolerance: Fraction, sure: bool, prior: Entries
    ) -> tuple[Entries, Value]:
        """One more term; what rounding has left of a variance below zero is taken for zero."""
        if len(P.terms) == PENDING:
            P = self.written(P)
        space, n = P.space, self.n
        array = space.array(f"c{len(P.terms)}", n)
        fill(t, array, c)
        weight = t.name(t.value(1 / s), "weight")
        P = replace(P, terms=(*P.terms, Term(array, weight)))
        if sure:
            return P, t.wrapped(t.pool.boolean(False))
        P = self.written(P)
        own, worst = Array(t, P.array), t.variable(t.unique("worst"), 0)
        with t.loop("i", 0, n) as i:
            place = upper_start(i) + i
            variance = t.name(own[place], "variance")
            before = variance + array[i] * array[i] * weight
            # the points' rounding is in c
            worst.set(select(variance < -(before * (1024 * tolerance)), 1, worst.get()))
            low = t.name(variance < 0, "negative")
            t.flag(low, "REGULARIZED")
            own[place] = select(low, 0, variance)
        return P, worst.get() > 0

    def placed(self, P: Entries) -> dict[str, Array]:
        """Local arrays that hold P as the fields of the struct do."""
        return {"kf.P": Array(P.space.t, self.written(P).array)}

    # the covariance ----------------------------------------------------------------------------------

    def entries(self, P: Entries) -> Symmetric:  # type: ignore[override]
        return Symmetric(self.n, lambda i, j: self._entry(P, i, j))

    def _entry(self, P: Entries, i: int, j: int) -> Value:
        """P_ij, i <= j."""
        t, start = P.space.t, P.start(i, j)
        if start < 0:
            total: Number = P.at(self.n, i, j)
        else:
            term = P.terms[start]
            total = linalg.times(term.share, term.c[j if term.state == i else i])
        for term in P.terms[start + 1 :]:
            total = linalg.minus(total, linalg.times(linalg.times(term.weight, term.c[i]), term.c[j]))
        return t.value(total)

    def written(self, P: Entries) -> Entries:
        """P in a packed array of the function's own, without terms."""
        if P.array and not P.terms and not P.square:
            return P
        target = P.space.array("covariance", self.n * (self.n + 1) // 2)
        self._write(P, target.name, target.__setitem__)
        return Entries(P.space, target.name)

    def _write(self, P: Entries, target: str, put_at: Put) -> None:
        """All entries into a packed array."""
        t, n = P.space.t, self.n
        if P.terms:
            self._less_terms(P, target, put_at)
        elif P.square:
            with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
                put_at(upper_start(j) + i, P.at(n, i, j))
        else:
            with t.loop("k", 0, n * (n + 1) // 2) as k:
                put_at(k, P.at_place(k))

    def _less_terms(self, P: Entries, target: str, put_at: Put) -> None:
        """P0 less the terms. A row that is told afresh starts at its share of c; earlier terms leave it alone."""
        t, n = P.space.t, self.n
        source, last = P.array, target == "kf.P"
        hidden: list[tuple[Array, int, Value]] = []
        if any(term.state is not None for term in P.terms) and target != (P.array or "kf.P"):
            with t.loop("k", 0, n * (n + 1) // 2) as k:
                put_at(k, P.at_place(k))
            source = target
        for number, term in enumerate(P.terms):
            if term.state is None or term.share is None:
                continue
            given: list[Given] = [(target, 0), integer(t, term.state), (term.c.name, 0), term.share]
            t.call(put_row(self.kernels, n), given)
            for earlier in P.terms[: number + 1]:
                if not last:
                    hidden.append((earlier.c, term.state, t.name(earlier.c[term.state], "hidden")))
                earlier.c[term.state] = 0
        P = replace(P, array="" if source == "kf.P" else source)
        with t.loop("j", 0, n) as j:
            parts = [t.name(term.c[j] * term.weight, "part") for term in P.terms]
            with t.loop("i", 0, j + 1) as i:
                total = P.at(n, i, j)
                for term, part in zip(P.terms, parts, strict=True):
                    total = total - term.c[i] * part
                put_at(upper_start(j) + i, total)
        for c, state, value in reversed(hidden):  # the gains are still asked for
            c[state] = value

    def variance(self, P: Entries, h: Vector) -> Number:  # type: ignore[override]
        return super().variance(self.entries(P), h)

    def tolerance(self, P: Entries, h: Vector) -> Value | int:  # type: ignore[override]
        return super().tolerance(self.entries(P), h)

    def inflated(self, P: Entries, a: Number) -> Entries:  # type: ignore[override]
        P = self.written(P)
        array = Array(P.space.t, P.array)
        with P.space.t.loop("k", 0, self.n * (self.n + 1) // 2) as k:
            array[k] = array[k] * a
        return P

    def limit(  # type: ignore[override]
        self, t: Trace, P: Entries, floors: list[Fraction | None], ceilings: list[Fraction | None]
    ) -> Entries:
        if not P.square:
            P = self.written(P)
        n, array = self.n, Array(t, P.array)

        def place(i: int | Value, j: int | Value) -> int | Value:
            if P.square:
                return j * n + i
            return (upper_start(j) if isinstance(j, Value) else upper(0, j)) + i

        def limited(i: int, limit: Fraction, below: bool) -> Value:
            variance = t.name(array[place(i, i)], f"p_{self.names[i]}")
            beyond = t.name(variance < limit if below else variance > limit, "beyond")
            t.flag(beyond, "REGULARIZED")
            array[place(i, i)] = select(beyond, limit, variance)
            return t.value(1 if below else select(beyond, sqrt(limit / variance), 1))

        for i, floor in enumerate(floors):
            if floor is not None:
                limited(i, floor, below=True)
        if all(ceiling is None for ceiling in ceilings):
            return P
        scale = P.space.array("row", n)
        put(t, scale.__setitem__, [t.one if high is None else t.name(limited(i, high, below=False), "root")
                                   for i, high in enumerate(ceilings)])  # fmt: skip
        with t.loop("j", 1, n) as j, t.loop("i", 0, j) as at:
            array[place(at, j)] = array[place(at, j)] * (scale[at] * scale[j])
        return P

    def evidence(self, P: Entries, after_predict: bool) -> list[Value]:  # type: ignore[override]
        if not (after_predict or self.form == "joseph"):
            return []
        t, n = P.space.t, self.n
        total = t.variable(t.unique("trace"), 0)
        with t.loop("i", 0, n) as i:
            part = P.at(n, i, i)
            for term in P.terms:
                part = linalg.plus(part, term.weight * (term.c[i] * term.c[i]))
            total.set(total.get() + t.value(part))
        return [total.get()]

    def store(self, t: Trace, P: Entries, names: list[str], after_predict: bool) -> None:  # type: ignore[override]
        if P.array or P.terms:
            self._write(P, "kf.P", lambda place, value: t.store("kf.P", place, value))
