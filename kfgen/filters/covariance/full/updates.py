"""Scalar measurements of a full covariance in loops: standard ones put off as terms, Joseph's made at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from kfgen.filters.algebra.linalg import Vector, dot, minus, plus, times
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import Number, is_constant, is_one, is_positive, is_zero, reciprocal, select
from kfgen.filters.algebra.triangles import upper_start
from kfgen.filters.covariance.full.rounding import UNITS, inverse_of, lifting, not_negative, single_state, spoilt_by
from kfgen.filters.covariance.full.terms import PENDING, ArrayEntries, Term
from kfgen.filters.covariance.kernels.function import Kernels, Passed, integer
from kfgen.filters.covariance.kernels.rows import add_terms, put_row, take_row
from kfgen.filters.covariance.loops.motion import ArrayGain, Displacement, array_of_gain, changed_gain
from kfgen.filters.covariance.parts import GainChange, Scalar
from kfgen.ir.trace import Array, Trace, Value


@dataclass(frozen=True)
class Updates:
    """form: `joseph` or `standard`. steps: whether what each measurement moves the state by is asked for."""

    kernels: Kernels
    form: str
    change: GainChange | None
    epsilon: Fraction
    steps: bool

    def update(
        self, t: Trace, P: ArrayEntries, measurements: list[Scalar], motion: Displacement
    ) -> tuple[ArrayEntries, list[ArrayGain]]:
        """See Form.update."""
        (scalar,) = measurements
        nu, measurement = scalar.innovation(motion), scalar.measurement
        make = self._joseph if self.form == "joseph" else self._standard
        P, gain = make(t, P, measurement, motion, nu)
        if not is_positive(measurement.r):
            P = self._not_negative(P, measurement, gain)
        return P, [gain]

    def _standard(
        self, t: Trace, P: ArrayEntries, measurement: Measurement, motion: Displacement, nu: Value
    ) -> tuple[ArrayEntries, ArrayGain]:
        """P - g K s K^T, put off: one more term."""
        if len(P.terms) == PENDING:
            P = P.written()
        space, h, r, g, direct = P.space, measurement.h, measurement.r, measurement.g, _is_direct(P, measurement)
        number = len(P.terms)
        c = array_of_gain(space, f"c{number}", P.n, motion, self.steps)
        seen = [i for i, x in enumerate(h) if not is_zero(x)]
        self._times(P, h, seen, c)
        s, spoilt = self._spread(t, measurement, c, direct)
        plain, inverse = inverse_of(s, r, self.epsilon)
        t.name(inverse, "inverse_s")
        weight = t.name(t.value(times(g, inverse)), "weight")
        state: int | None = None
        share: Value | None = None
        if len(seen) == 1 and is_constant(h[seen[0]]):
            state = seen[0]
            share = t.name(t.value(times(r if is_one(h[state]) else r / h[state], inverse)), "share")
        P = replace(P, terms=(*P.terms, Term(c, weight, state, share)))
        return P, ArrayGain(t, c, nu, s, not direct, inverse, plain, spoilt)

    def _spread(self, t: Trace, measurement: Measurement, c: Array, direct: bool) -> tuple[Value, Value | None]:
        """s, and the condition under which rounding has spoilt it. direct: it is a variance of the struct."""
        h, r = measurement.h, measurement.r
        seen = [i for i, x in enumerate(h) if not is_zero(x)]
        spread = dot([h[i] for i in seen], [c[i] for i in seen])
        bounded = not direct and not is_positive(r)
        s = t.value(plus(times(measurement.g, not_negative(spread) if bounded and seen else spread), r))
        if direct or bounded:
            return s, None
        return s, spoilt_by(s, r) if single_state(h) < 0 else t.value(spread) < 0

    def _times(self, P: ArrayEntries, h: Vector, seen: list[int], c: Array) -> None:
        """c = P h^T."""
        t, n, space = P.space.t, P.n, P.space
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
                    factors[k] = t.value(plus(factors.get(k, 0), times(h[i], term.share)))
                elif k > start:
                    part = times(times(h[i], term.weight), term.c[i])
                    removed[k] = t.value(plus(removed.get(k, 0), part))
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
                    scaled = times(part, row[at])
                    c[at] = plus(c[at], scaled) if number else scaled
        if factors or removed:
            with t.loop("i", 0, n) as at:
                total: Number = c[at] if fresh else 0
                for k, factor in factors.items():
                    total = plus(total, times(factor, P.terms[k].c[at]))
                for k, factor in removed.items():
                    total = minus(total, times(factor, P.terms[k].c[at]))
                c[at] = total
        for state in sorted({term.state for term in P.terms if term.state is not None}):
            entries = [P.entry(min(i, state), max(i, state)) for i in seen]
            c[state] = t.value(dot([h[i] for i in seen], entries))

    def _joseph(
        self, t: Trace, P: ArrayEntries, measurement: Measurement, motion: Displacement, nu: Value
    ) -> tuple[ArrayEntries, ArrayGain]:
        """A = P - g K h P, then A - g (A h^T - r K) K^T, for any gain, in a copy of P."""
        direct = _is_direct(P, measurement)
        P = P.written()
        n, space = P.n, P.space
        h, g = measurement.h, measurement.g
        seen = [i for i, x in enumerate(h) if not is_zero(x)]
        c, rest = space.array("c0", n), space.array("rest", n)
        gain = array_of_gain(space, "gain", n, motion, self.steps)
        self._times(P, h, seen, c)
        s, spoilt = self._spread(t, measurement, c, direct)
        t.name(s, "s")
        r = measurement.r
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
                before = times(r, gain[i]) if number == 0 else rest[i]
                rest[i] = t.value(minus(before, times(factor, partial)))
        if not seen:
            return P, ArrayGain(t, gain, nu, s, sound=True)
        but = single_state(h) if single_state(h) >= 0 else n
        terms: list[Passed] = [(P.array, 0), (c.name, 0), (weighted.name, 0), (rest.name, 0)]
        terms += [t.value(lifting(s, r)), integer(t, but)]
        t.call(add_terms(self.kernels, n, UNITS * self.epsilon), terms)
        exact = len(seen) == 1 and is_constant(h[seen[0]]) and is_zero(r) and is_one(g) and self.change is None
        if exact:  # known exactly, not up to rounding
            t.call(put_row(self.kernels, n), [(P.array, 0), integer(t, seen[0]), (rest.name, 0), t.zero])
        return P, ArrayGain(t, gain, nu, s, not direct, spoilt=spoilt)

    def _not_negative(self, P: ArrayEntries, measurement: Measurement, gain: ArrayGain) -> ArrayEntries:
        """A variance that an exact measurement took to zero may come out below it by round-off: back to zero."""
        c = P.terms[-1].c if self.form == "standard" else P.space.arrays["c0"]
        P = P.written()
        t, array = P.space.t, Array(P.space.t, P.array)
        g = t.value(measurement.g)
        with t.loop("i", 0, P.n) as i:
            place = upper_start(i) + i
            variance = t.name(array[place], "variance")
            k = gain.array[i] if gain.factor is None else gain.array[i] * gain.factor
            old = variance + times(g, k) * c[i]
            low = t.name((variance < 0) & (variance >= -(old * (4 * P.n * self.epsilon))), "negative")
            t.flag(low, "REGULARIZED")
            array[place] = select(low, 0, variance)
        return P


def _is_direct(P: ArrayEntries, measurement: Measurement) -> bool:
    """Whether a row measures a variance of the struct: only who has written it there can have made it negative."""
    return single_state(measurement.h) >= 0 and not P.terms and not P.array
