"""What sigma points need of factors in loops, as private functions of the emitted file: to take away, to solve."""

from __future__ import annotations

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.covariance.kernels.function import Given, Kernels, array_argument, number_argument
from kfgen.filters.frame.triangles import strict_start, upper_start
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


def _backwards(t: Trace, U: Given, c: Given, n: int) -> None:
    """c <- U^-1 c."""
    with t.loop("j", 0, n, down=True) as j:
        v = t.name(c[j], "v")
        with t.loop("i", 0, j) as i:
            c[i] = c[i] - U[strict_start(j) + i] * v


def _factors(n: int, constant: bool) -> list[tuple[str, int, bool]]:
    return [("factor", n * (n - 1) // 2, constant), ("diagonal", n, constant), ("c", n, False)]


def remove(kernels: Kernels, n: int, sure: bool) -> Function:
    """U D U^T -= c c^T / s (see `measurement.downdate`). sure: no direction without spread is to be left alone."""

    def body(t: Trace) -> None:
        U, D, c = (Given(t, name) for name in ("factor", "diagonal", "c"))
        _backwards(t, U, c, n)
        share, gain = t.array("share", n), t.array("gain", n)
        left = t.variable("rest", t.field("s"))
        with t.loop("j", 0, n) as j:
            v = t.name(c[j] if sure else select(_known(t, U, D, n, j), 0, c[j]), "v")
            d = t.name(D[j], "d")
            f = t.name(v * select(d > t.smallest, 1 / d, 0), "f")
            c[j] = v
            share[j] = f
            left.set(left.get() - f * v)
        Given(t, "left")[0] = left.get()
        before = t.variable("before", select(left.get() < 0, 0, left.get()))
        with t.loop("j", 0, n) as j:
            f, v = t.name(share[j], "f"), t.name(c[j], "v")
            after = t.name(before.get() + f * v, "after")
            some = t.name(after > t.smallest, "some")
            inverse = t.name(select(some, 1 / after, 0), "inverse")
            b = t.name(v * inverse, "b")
            D[j] = D[j] * select(some, before.get() * inverse, 1)
            with t.loop("i", 0, j) as i:
                place = strict_start(j) + i
                k = t.name(gain[i], "k_i")
                u = t.name(U[place] - f * k, "u")
                U[place] = u
                gain[i] = k + b * u
            gain[j] = b
            before.set(after)

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
    """c <- (U D U^T)^-1 c."""

    def body(t: Trace) -> None:
        U, D, c = (Given(t, name) for name in ("factor", "diagonal", "c"))
        _backwards(t, U, c, n)
        with t.loop("j", 0, n) as j:
            known = _known(t, U, D, n, j)
            d = t.name(D[j], "d_j")
            total = t.variable("total", c[j] * select((d > t.smallest) & ~known, 1 / d, 0))
            with t.loop("i", 0, j) as i:
                total.set(total.get() - U[strict_start(j) + i] * c[i])
            c[j] = total.get()

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
        with t.loop("j", 0, n) as j:
            pivot = t.name(rest[upper_start(j) + j], "pivot")
            limit = t.name(P[upper_start(j) + j] * t.field("tolerance"), "limit")
            failed.set(select(~(pivot >= -limit), 1, failed.get()))
            inverse = t.name(select(pivot > limit, 1 / pivot, 0), "inverse")
            with t.loop("k", j + 1, n) as k:
                u = t.name(rest[upper_start(k) + j] * inverse, "u")
                with t.loop("i", j + 1, k + 1) as i:
                    place = upper_start(k) + i
                    rest[place] = rest[place] - u * rest[upper_start(i) + j]
        Given(t, "told")[0] = failed.get()

    arguments = [array_argument("P", n * (n + 1) // 2, constant=True), number_argument("tolerance"),
                 array_argument("told", 1)]  # fmt: skip
    return kernels.function("pivots", arguments, "told: whether P is indefinite beyond `tolerance`, relative", body)
