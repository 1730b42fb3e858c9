"""Rows of a full covariance, in loops: taken, replaced, and Joseph's form."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.triangles import upper_start
from kfgen.filters.covariance.kernels.function import (
    Given,
    Kernels,
    array_argument,
    counter,
    counter_argument,
    number_argument,
)
from kfgen.ir.program import Function
from kfgen.ir.trace import Trace


def take_row(kernels: Kernels, n: int) -> Function:
    """Row i of a packed upper triangle, whole."""

    def body(t: Trace) -> None:
        P, row = Given(t, "P"), Given(t, "row")
        i = counter(t, "i")
        with t.loop("j", 0, i + 1) as j:
            row[j] = P[upper_start(i) + j]
        with t.loop("j", i + 1, n) as j:
            row[j] = P[upper_start(j) + i]

    arguments = [array_argument("P", n * (n + 1) // 2, constant=True), counter_argument("i"), array_argument("row", n)]
    return kernels.function("take_row", arguments, "Row i of a symmetric matrix", body)


def put_row(kernels: Kernels, n: int) -> Function:
    """Replace row and column i of a packed upper triangle by a multiple of a vector."""

    def body(t: Trace) -> None:
        P, row, factor = Given(t, "P"), Given(t, "row"), t.field("factor")
        i = counter(t, "i")
        with t.loop("j", 0, i + 1) as j:
            P[upper_start(i) + j] = row[j] * factor
        with t.loop("j", i + 1, n) as j:
            P[upper_start(j) + i] = row[j] * factor

    arguments = [array_argument("P", n * (n + 1) // 2), counter_argument("i")]
    arguments += [array_argument("row", n, constant=True), number_argument("factor")]
    return kernels.function("put_row", arguments, "Replace row and column i of a symmetric matrix by factor row", body)


def add_terms(kernels: Kernels, n: int, units: Fraction) -> Function:
    """Joseph's form in the end: P - gain c^T + rest gain^T, the upper triangle. In the variances of states that are not
    themselves measured (one, `but`, may be) units of s come to r: see `full.rounding`."""

    def body(t: Trace) -> None:
        P, c, gain, rest = (Given(t, name) for name in ("P", "c", "gain", "rest"))
        but, lift = counter(t, "but"), t.name(t.field("s") * units, "lift")
        with t.loop("j", 0, n) as j:
            c_j, gain_j = t.name(c[j], "c_j"), t.name(gain[j], "gain_j")
            with t.loop("i", 0, j) as i:
                P[upper_start(j) + i] = P[upper_start(j) + i] - gain[i] * c_j + rest[i] * gain_j
            more = t.name(t.select((j < but) | (but < j), lift, 0), "more")
            place = upper_start(j) + j
            P[place] = P[place] - gain_j * c_j + (rest[j] + gain_j * more) * gain_j

    arguments = [array_argument("P", n * (n + 1) // 2)]
    arguments += [array_argument(name, n, constant=True) for name in ("c", "gain", "rest")]
    arguments += [number_argument("s"), counter_argument("but")]
    doc = "P <- P - gain c^T + rest gain^T, and of variances but one what rounding takes"
    return kernels.function("joseph", arguments, doc, body)
