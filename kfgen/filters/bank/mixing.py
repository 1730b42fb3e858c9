"""Mixtures of the estimates of modes: weights, the mean, the covariance in any form (Blom & Bar-Shalom 1988).

x = sum_i w_i x_i, P = sum_i w_i (P_i + d_i d_i^T), d_i = x_i - x. The estimates are taken in one after another: a
part of weight w joins a mixture of weight W at the distance e with the spread W w / (W + w) e e^T. So the spread of
B modes takes B - 1 columns, and none is ever taken away.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Vector, plus, times
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_one,
    is_positive,
    is_zero,
    reciprocal,
    select,
)  # fmt: skip
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.covariance.base import Straight
from kfgen.filters.covariance.noise import Given
from kfgen.filters.steps.resetting import seen_at
from kfgen.geometry import heaviest
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model


@dataclass(frozen=True)
class Estimate:
    """Of a mode: x (n,) in the spec's order, P in its form."""

    x: list[Value]
    form: Straight[Any]
    P: Any


@dataclass(frozen=True)
class Spread:
    """The mean of a mixture, angles not wrapped, and its spread, as columns (n,) with their weights. Spec's order.

    apart: of models with rotations, how far each mode is from the mean (n,)."""

    mean: list[Value]
    columns: list[tuple[Vector, Number]]
    apart: dict[int, list[Value]] = field(default_factory=dict)


@dataclass(frozen=True)
class Joining:
    """How a part joins the mixture of those before it. before: their weight; share: the part's in both."""

    before: Number
    share: Number

    @property
    def weight(self) -> Number:
        """Of the spread between them."""
        return times(self.before, self.share)


def joining(weights: list[Number], parts: list[int]) -> Iterator[Joining]:
    """Of all parts but the first. weights: those of the parts sum to 1."""
    weight = weights[parts[0]]
    for place, i in enumerate(parts[1:], 1):
        share = weights[i]
        if place < len(parts) - 1:
            total = weight + weights[i]
            share = times(share, 1 / total if is_positive(total) else reciprocal(assume_nonnegative(total))[1])
        yield Joining(weight, share)
        if place < len(parts) - 1:
            weight = total


def spread(t: Trace, model: Model, states: list[list[Value]], weights: list[Number], first: int) -> Spread:
    """Of modes whose weights sum to 1. first: the mode that the others join."""
    parts = [first, *(i for i in range(len(states)) if i != first)]
    parts = [i for i in parts if not is_zero(weights[i])]
    if model.rotations:
        return _turned(t, model, states, weights, parts)
    base: list[Value] = list(states[parts[0]])
    straight = sorted(parts)
    for k, _, part in model.space.singles:
        if not part.flat and len(parts) > 1:
            base[k] = t.name(heaviest([states[i][k] for i in straight], [weights[i] for i in straight], select),
                             f"{model.states[k]}_base")  # fmt: skip
    deltas: list[Vector] = []
    for i in parts:
        delta: Vector = []
        for k, _, part in model.space.singles:
            delta.append(0 if base[k].node is states[i][k].node else part.local(states[i][k], base[k]))
        deltas.append(delta)
    mean = deltas[0]
    columns: list[tuple[Vector, Number]] = []
    for delta, step in zip(deltas[1:], joining(weights, parts), strict=True):
        e = [linalg.minus(d, m) for d, m in zip(delta, mean, strict=True)]
        columns.append((e, step.weight))
        mean = [plus(m, times(step.share, d)) for m, d in zip(mean, e, strict=True)]
    return Spread([t.value(plus(b, m)) for b, m in zip(base, mean, strict=True)], columns)


def _turned(t: Trace, model: Model, states: list[list[Value]], weights: list[Number], parts: list[int]) -> Spread:
    """The same about the mode of the largest weight, in the tangent space there: the distances are those from the
    mean."""
    base = list(states[parts[0]])
    if len(parts) == 1:
        return Spread(base, [], {})
    straight, space = sorted(parts), model.space
    for k in range(space.size):
        chosen = heaviest([states[i][k] for i in straight], [weights[i] for i in straight], select)
        base[k] = t.name(chosen, f"{model.states[k]}_base")
    deltas = {i: space.local(states[i], base) for i in parts}
    shift = [t.value(linalg.dot([weights[i] for i in parts], [deltas[i][j] for i in parts]))
             for j in range(space.dimension)]  # fmt: skip
    mean = space.retract(base, shift)
    apart = {}
    for i in parts:
        d = [t.value(a - b) for a, b in zip(deltas[i], shift, strict=True)]
        for r in model.rotations:
            own = slice(r.first, r.first + 4)
            d[r.first_error : r.first_error + 3] = r.geometry.local(states[i][own], mean[own])
        apart[i] = [t.name(v, f"apart_{name}") for v, name in zip(d, model.errors, strict=True)]
    for i, j, _ in space.singles:
        mean[i] = base[i] + shift[j]
    columns: list[tuple[Vector, Number]] = [(list(d), weights[i]) for i, d in apart.items()]
    return Spread(mean, columns, apart)


def seen_from_mean(t: Trace, model: Model, parts: list[Estimate], spreads: Spread) -> list[Estimate]:
    """The covariances of modes as they are seen from the mean: J P J^T, J = d((x_i [+] d) [-] x)/dd."""
    out = []
    for i, part in enumerate(parts):
        if i in spreads.apart:
            n, form = part.form.n, part.form
            J = seen_at(t, model, form.order, spreads.apart[i])
            P = form.turned(t, part.P, J, Given([[t.zero] * n for _ in range(n)]), [])
            part = Estimate(part.x, form, P)
        out.append(part)
    return out


def mixed(t: Trace, parts: list[Estimate], weights: list[Number], spreads: Spread, own: int) -> Any:
    """The covariance of a mixture in the form of one of its parts."""
    form = parts[own].form
    columns = [(_ordered(column, form), weight) for column, weight in spreads.columns]
    if not form.factored:
        dense = [_Dense(part) for part in parts]

        def entry(a: int, b: int) -> Value:
            i, j = form.order[a], form.order[b]
            total: Number = 0
            for P, w in zip(dense, weights, strict=True):
                if not is_zero(w):
                    total = plus(total, times(w, P(i, j)))
            for column, w in columns:
                total = plus(total, times(times(column[a], w), column[b]))
            return t.value(total)

        return form.from_entries(Symmetric(form.n, entry))
    U, D = form.factors(parts[own].P)
    D = [times(weights[own], d) for d in D]
    if is_zero(weights[own]):
        U, D = linalg.zeros(form.n, form.n), [0] * form.n
    added: list[tuple[Vector, Number, int]] = []
    for i, part in enumerate(parts):
        if i == own or is_zero(weights[i]):
            continue
        same = part.form.order == form.order
        for k, (column, weight) in enumerate(part.form.columns(part.P)):
            straight: Vector = [0] * form.n
            for place, value in zip(part.form.order, column, strict=True):
                straight[place] = value
            added.append((_ordered(straight, form), times(weight, weights[i]), k if same else -1))
    added += [(column, weight, -1) for column, weight in columns]
    for c in range(0, len(added), form.group):
        rank_one(U, D, added[c : c + form.group], safe=not form.reorders)
    return form.from_factors(t, U, D)


def _ordered(column: Vector, form: Straight[Any]) -> Vector:
    """From the spec's order to the form's."""
    return [column[i] for i in form.order]


class _Dense:
    """Entries of a covariance by states of the spec."""

    def __init__(self, part: Estimate) -> None:
        self.P = part.form.entries(part.P)
        self.place = {state: i for i, state in enumerate(part.form.order)}

    def __call__(self, i: int, j: int) -> Number:
        return self.P[self.place[i], self.place[j]]


def transition(t: Trace, M: list[list[Value]], mu: list[Value]) -> tuple[list[list[Number]], list[Value]]:
    """w (B, B), w_ij the weight of mode i in what mode j starts from, and c (B): what mu becomes.

    c_j = sum_i M_ij mu_i, w_ij = M_ij mu_i / c_j. A mode that cannot be the present one (c_j = 0) keeps its own.
    """
    count = len(mu)
    w: list[list[Number]] = [[0] * count for _ in range(count)]
    c: list[Value] = []
    for j in range(count):
        joint: Vector = [times(M[i][j], mu[i]) for i in range(count)]
        sources = [i for i in range(count) if not is_zero(joint[i])]
        total = t.value(sum((joint[i] for i in sources[1:]), joint[sources[0]]) if sources else 0)
        c.append(total)
        if not sources:
            w[j][j] = 1
            continue
        if sources == [j]:
            w[j][j] = 1
            continue
        sure = is_positive(total)
        some, inverse = (None, 1 / total) if sure else reciprocal(assume_nonnegative(total))
        for i in sources:
            share = t.one if len(sources) == 1 else joint[i] * inverse
            w[i][j] = share if sure else select(some, share, 1 if i == j else 0)
        if not sure and j not in sources:
            w[j][j] = select(some, t.zero, t.one)
    return w, c


def normalised(values: list[Value]) -> list[Value]:
    """Divided by their sum, which is positive."""
    inverse = 1 / sum(values[1:], values[0])
    return [v if is_one(v) else v * inverse for v in values]
