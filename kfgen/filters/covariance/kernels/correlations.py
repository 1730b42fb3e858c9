"""What round-off may not do to a full covariance: private functions that run only where it may have done so."""

from __future__ import annotations

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.triangles import upper_size, upper_start
from kfgen.filters.covariance.kernels.function import (
    Given,
    Kernels,
    array_argument,
    counter,
    counter_argument,
    select_counter,
)
from kfgen.ir.program import Function
from kfgen.ir.trace import Trace


def limit(kernels: Kernels, n: int) -> Function:
    """|P_ij| <= sqrt(P_ii P_jj)."""

    def body(t: Trace) -> None:
        P = Given(t, "P")
        with t.loop("j", 1, n) as j, t.loop("i", 0, j) as i:
            place = upper_start(j) + i
            product = P[upper_start(i) + i] * P[upper_start(j) + j]
            own, most = t.name(P[place], "own"), t.name(sqrt(product), "most")
            P[place] = select(own > most, most, select(own < -most, -most, own))

    arguments = [array_argument("P", upper_size(n))]
    return kernels.function("limit_correlations", arguments, "|P_ij| <= sqrt(P_ii P_jj)", body)


def settle(kernels: Kernels, n: int) -> Function:
    """A variance below zero is what rounding has left of it: as much may it be, and of its correlations nothing is
    known. all: nothing of any is."""

    def body(t: Trace) -> None:
        P, every = Given(t, "P"), counter(t, "all")
        with t.loop("j", 0, n) as j:
            own = t.name(P[upper_start(j) + j], "own")
            with t.when((own < 0) | (every > 0)):
                with t.loop("i", 0, n) as i:
                    P[select_counter(i < j, upper_start(j) + i, upper_start(i) + j)] = 0
                P[upper_start(j) + j] = t.function("abs", own)
                t.flag(t.wrapped(t.pool.boolean(True)), "REGULARIZED")

    arguments = [array_argument("P", upper_size(n)), counter_argument("all")]
    doc = "Variances below zero: as large as rounding has left them, without correlations. all: none has any"
    return kernels.function("settle", arguments, doc, body, returns="status")
