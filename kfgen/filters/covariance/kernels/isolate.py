"""A state that is known anew, from elsewhere: its variance set and its correlations gone, in factors of a covariance.

Without row and column j the covariance is U D U^T with row j of U struck out, and column j with it but for what stands
above the diagonal: that joins the leading part as a term of rank one, which is positive, so that nothing can fail.
"""

from __future__ import annotations

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.triangles import strict_size, strict_start, upper_size, upper_start
from kfgen.filters.covariance.kernels.function import (
    Given,
    Kernels,
    array_argument,
    counter,
    counter_argument,
    number_argument,
)
from kfgen.filters.covariance.kernels.updates import take_in
from kfgen.ir.program import Function
from kfgen.ir.trace import Trace


def isolate(kernels: Kernels, n: int) -> Function:
    """In U and D. The term is taken in as by Agee & Turner (Bierman 1977, III.4)."""

    def body(t: Trace) -> None:
        U, D, own = Given(t, "factor"), Given(t, "diagonal"), counter(t, "place")
        w = t.array("w", n)
        with t.loop("i", 0, own) as i:
            place = strict_start(own) + i
            w[i] = U[place]
            U[place] = 0
        with t.loop("j", own + 1, n) as j:
            U[strict_start(j) + own] = 0
        weight = t.variable("left", D[own])
        D[own] = t.field("variance")
        take_in(t, (U, D, w), weight, own)

    arguments = [array_argument("factor", strict_size(n)), array_argument("diagonal", n), counter_argument("place"),
                 number_argument("variance")]  # fmt: skip
    return kernels.function("isolate", arguments, "U D U^T with a variance of its own at `place`, uncorrelated", body)


def isolate_root(kernels: Kernels, n: int) -> Function:
    """In a lower root, row by row. The column below the diagonal is taken in by rotations (Golub & Van Loan 2013,
    6.5.4)."""

    def body(t: Trace) -> None:
        S, own = Given(t, "root"), counter(t, "place")
        w = t.array("w", n)
        with t.loop("j", 0, own) as j:
            S[upper_start(own) + j] = 0
        S[upper_start(own) + own] = sqrt(t.field("variance"))
        with t.loop("i", own + 1, n) as i:
            place = upper_start(i) + own
            w[i] = S[place]
            S[place] = 0
        with t.loop("j", own + 1, n) as j:
            place = upper_start(j) + j
            d, s = t.name(S[place], "d"), t.name(w[j], "s")
            r = t.name(sqrt(d * d + s * s), "r")
            some = t.name(r > t.smallest, "some")
            c, s = t.name(select(some, d / r, 1), "cosine"), t.name(select(some, s / r, 0), "sine")
            S[place] = r
            with t.loop("i", j + 1, n) as i:
                place = upper_start(i) + j
                a, w_i = t.name(S[place], "a"), t.name(w[i], "w_i")
                S[place] = c * a + s * w_i
                w[i] = c * w_i - s * a

    arguments = [array_argument("root", upper_size(n)), counter_argument("place"), number_argument("variance")]
    doc = "S S^T with a variance of its own at `place`, uncorrelated"
    return kernels.function("isolate_root", arguments, doc, body)
