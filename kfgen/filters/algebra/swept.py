"""Algorithms on factors that are written once for straight-line code and for loops (see `sweep`).

U, P: entries by [i, j], i <= j. Vectors: by [i]. Numbers as of `numbers`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kfgen.filters.algebra.linalg import minus, plus, times
from kfgen.filters.algebra.numbers import (
    Number,
    assume_nonnegative,
    is_positive,
    is_zero,
    reciprocal,
    select,
)  # fmt: skip
from kfgen.filters.algebra.sweep import Index, Sweep


def backwards(sweep: Sweep, n: int, U: Any, c: Any) -> None:
    """c <- U^-1 c, U unit upper triangular."""
    for j in sweep.each("j", 0, n, down=True):
        v = sweep.name(c[j], "v")
        for i in sweep.each("i", 0, j):
            c[i] = minus(c[i], times(U[i, j], v))


def solve(sweep: Sweep, n: int, U: Any, c: Any, inverse: Callable[[Index], Number]) -> None:
    """c <- (U D U^T)^-1 c. inverse(j): 1 / D_j, or 0 of a direction without spread."""
    backwards(sweep, n, U, c)
    for j in sweep.each("j", 0, n):
        total = sweep.cell("total", times(c[j], inverse(j)))
        for i in sweep.each("i", 0, j):
            total.set(minus(total.get(), times(U[i, j], c[i])))
        c[j] = total.get()


def remove(sweep: Sweep, n: int, U: Any, D: Any, c: Any, s: Number, known: Callable[[Index], Any] | None) -> Number:
    """U D U^T -= c c^T / s, s > 0, in place: Bierman's update for an h with P h^T = c and r = s - h P h^T.

    Returns r; where it is negative it counts as 0. known(j): whether direction j is without spread, so that what c has
    there is round-off. c is used up.
    """
    backwards(sweep, n, U, c)
    share, gain = sweep.vector("share", n), sweep.vector("gain", n)
    rest = sweep.cell("rest", 0)
    for j in sweep.each("j", 0, n):
        v = sweep.name(c[j] if known is None else select(known(j), 0, c[j]), "v")
        d = sweep.name(D[j], "d")
        f = sweep.name(times(v, 1 / d if is_positive(d) else reciprocal(d)[1]), "f")
        c[j], share[j] = v, f
        rest.set(plus(rest.get(), times(f, v)))
    r = sweep.name(s - rest.get(), "r")
    before = sweep.cell("before", assume_nonnegative(select(r < 0, 0, r)))
    for j in sweep.each("j", 0, n):
        f, v = sweep.name(share[j], "f"), sweep.name(c[j], "v")
        if is_zero(v):
            continue
        after = sweep.name(before.get() + f * v, "after")
        some, inverse = reciprocal(assume_nonnegative(after))
        b = sweep.name(times(v, sweep.name(inverse, "inverse")), "b")
        for i in sweep.each("i", 0, j):
            k, old = sweep.name(gain[i], "k_i"), U[i, j]
            new = sweep.name(minus(old, times(f, k)), "u")
            U[i, j] = new
            gain[i] = plus(k, times(b, new))
        gain[j] = b
        D[j] = assume_nonnegative(D[j] * select(some, before.get() * inverse, 1))
        before.set(after)
    return r


def indefinite(sweep: Sweep, n: int, P: Any, rest: Any, tolerance: Number, found: Callable[[Any], None]) -> None:
    """Tells `found` of each pivot of P whether it is negative by more than `tolerance` of its diagonal. rest: P, which
    is used up."""
    for j in sweep.each("j", 0, n):
        pivot = sweep.name(rest[j, j], "pivot")
        if is_zero(pivot):
            continue
        limit = sweep.name(P[j, j] * tolerance, "limit")
        found(~(pivot >= -limit))
        inverse = sweep.name(select(pivot > limit, 1 / pivot, 0), "inverse")
        for k in sweep.each("k", j + 1, n):
            u = sweep.name(times(rest[j, k], inverse), "u")
            for i in sweep.each("i", j + 1, k + 1):
                rest[i, k] = minus(rest[i, k], times(u, rest[j, i]))
