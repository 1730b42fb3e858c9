"""What round-off may do to a full covariance, as a private function that runs only where it may have done so."""

from __future__ import annotations

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.triangles import upper_size, upper_start
from kfgen.filters.covariance.kernels.function import Given, Kernels, array_argument
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
