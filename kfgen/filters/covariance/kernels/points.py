"""What sigma points need of factors in loops, as private functions of the emitted file: to take away, to solve."""

from __future__ import annotations

from kfgen.filters.algebra import swept
from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.sweep import InLoops, PackedStrict, PackedUpper
from kfgen.filters.algebra.triangles import strict_start
from kfgen.filters.covariance.kernels.function import Given, Kernels, array_argument, number_argument
from kfgen.ir.program import Function
from kfgen.ir.trace import Trace, Value


def _known(t: Trace, U: Given, D: Given, n: int, j: Value) -> Value:
    """Whether state j is known but for round-off: D_j is not above `tolerance` of its variance."""
    d = t.name(D[j], "d")
    variance = t.variable("variance", d)
    with t.loop("k", j + 1, n) as k:
        u = t.name(U[strict_start(k) + j], "u")
        variance.set(variance.get() + u * u * D[k])
    return t.name(~(d > variance.get() * t.field("tolerance")), "known")


def _factors(n: int, constant: bool) -> list[tuple[str, int, bool]]:
    return [("factor", n * (n - 1) // 2, constant), ("diagonal", n, constant), ("c", n, False)]


def remove(kernels: Kernels, n: int, sure: bool) -> Function:
    """U D U^T -= c c^T / s (see `algebra.swept.remove`). sure: no direction without spread is to be left alone."""

    def body(t: Trace) -> None:
        U, D, c = (Given(t, name) for name in ("factor", "diagonal", "c"))
        known = None if sure else lambda j: _known(t, U, D, n, j)
        Given(t, "left")[0] = swept.remove(InLoops(t), n, PackedStrict(U), D, c, t.field("s"), known)

    arguments = [array_argument(name, size) for name, size, _ in _factors(n, False)]
    arguments += [number_argument("s")] + [number_argument("tolerance")] * (not sure) + [array_argument("left", 1)]
    doc = "U D U^T -= c c^T / s; left: s - c^T (U D U^T)^-1 c, which is not to be negative; c is used up"
    return kernels.function("remove" if sure else "remove_any", arguments, doc, body)


def remove_root(kernels: Kernels, n: int) -> Function:
    """S S^T -= c c^T / s (see `Sqrt.downdated`)."""

    def body(t: Trace) -> None:
        S, D, w, small = (Given(t, name) for name in ("factor", "diagonal", "c", "small"))
        scale = t.name(1 / sqrt(t.field("s")), "scale")
        with t.loop("i", 0, n) as i:
            w[i] = w[i] * scale
        failed, gone, left = (t.variable(name, value) for name, value in (("failed", 0), ("gone", 0), ("left", 1)))
        with t.loop("j", 0, n, down=True) as j:
            s, w_j = t.name(D[j], "s_j"), t.name(w[j], "w_j")
            wanted = t.name((left.get() > 0) & (w_j * w_j > small[j]), "wanted")
            square = t.name(s * s - w_j * w_j, "square")
            limit = t.name(s * s * t.field("tolerance"), "limit")
            failed.set(select(wanted & (square < -limit), 1, failed.get()))
            ends = t.name(wanted & (square <= limit), "ends")
            acts = t.name(wanted & ~ends, "acts")
            gone.set(select(ends, 1, gone.get()))
            left.set(select(ends, 0, left.get()))
            r = t.name(sqrt(select(acts, square, 1)), "r")
            inverse = t.name(select(acts, 1 / s, 0), "inverse")
            cosine = t.name(select(acts, r * inverse, 1), "cosine")
            sine = t.name(w_j * inverse, "sine")
            quotient = t.name(select(acts, s * (1 / r), 1), "quotient")
            D[j] = select(ends, 0, select(acts, r, s))
            with t.loop("i", 0, j) as i:
                place = strict_start(j) + i
                w_i = t.name(w[i], "w_i")
                new = t.name((S[place] - sine * w_i) * quotient, "changed")
                w[i] = cosine * w_i - sine * new
                S[place] = select(ends, 0, new)
        Given(t, "told")[0] = failed.get()
        Given(t, "told")[1] = gone.get()

    arguments = [array_argument(name, size) for name, size, _ in _factors(n, False)]
    arguments += [array_argument("small", n, constant=True), number_argument("s"), number_argument("tolerance"),
                  array_argument("told", 2)]  # fmt: skip
    doc = "S S^T -= c c^T / s; told: whether it is indefinite, and whether round-off was taken for zero; c is used up"
    return kernels.function("remove_root", arguments, doc, body)


def solve(kernels: Kernels, n: int) -> Function:
    """c <- (U D U^T)^-1 c (see `algebra.swept.solve`)."""

    def body(t: Trace) -> None:
        U, D, c = (Given(t, name) for name in ("factor", "diagonal", "c"))

        def inverse(j: Value) -> Value:
            known = _known(t, U, D, n, j)
            d = t.name(D[j], "d_j")
            value: Value = select((d > t.smallest) & ~known, 1 / d, 0)
            return value

        swept.solve(InLoops(t), n, PackedStrict(U), c, inverse)

    arguments = [array_argument(name, size, constant) for name, size, constant in _factors(n, True)]
    arguments.append(number_argument("tolerance"))
    doc = "c <- (U D U^T)^-1 c; nothing of directions whose D is not above `tolerance` of the variance"
    return kernels.function("solve", arguments, doc, body)


def pivots(kernels: Kernels, n: int) -> Function:
    """Whether a pivot of P is negative beyond rounding (see `algebra.factors.indefinite`)."""

    def body(t: Trace) -> None:
        P = Given(t, "P")
        rest = t.array("rest", n * (n + 1) // 2)
        with t.loop("k", 0, n * (n + 1) // 2) as k:
            rest[k] = P[k]
        failed = t.variable("failed", 0)

        def found(negative: Value) -> None:
            failed.set(select(negative, 1, failed.get()))

        swept.indefinite(InLoops(t), n, PackedUpper(P), PackedUpper(rest), t.field("tolerance"), found)
        Given(t, "told")[0] = failed.get()

    arguments = [array_argument("P", n * (n + 1) // 2, constant=True), number_argument("tolerance"),
                 array_argument("told", 1)]  # fmt: skip
    return kernels.function("pivots", arguments, "told: whether P is indefinite beyond `tolerance`, relative", body)
