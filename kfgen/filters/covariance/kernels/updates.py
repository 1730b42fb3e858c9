"""Scalar measurements and columns absorbed, in loops over factors."""

from __future__ import annotations

from kfgen.filters.algebra.numbers import select, sqrt
from kfgen.filters.algebra.triangles import strict_start
from kfgen.filters.covariance.kernels.function import (
    Given,
    Kernels,
    array_argument,
    counter,
    counter_argument,
    number_argument,
    select_counter,
)
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value, Variable


def absorb(kernels: Kernels, n: int, sure: bool) -> Function:
    """U D U^T += weight_a a a^T + weight_b b b^T (Agee & Turner 1972; see `algebra.rank_one`), one pivot after another,
    so that an element of U is fetched once for both. sure: D is known to be positive.

    U <- t U + b w throughout: it loses no digits where D is far below what comes in.
    """

    def pivot(t: Trace, d: Value, s: Value, weight: Variable, label: str) -> tuple[Value, Value, Value]:
        v = t.name(weight.get() * s, f"v_{label}")
        new = t.name(d + s * v, f"d_{label}")
        if sure:
            inverse = t.name(1 / new, f"inverse_{label}")
            gain, ratio = v * inverse, d * inverse
        else:  # quotients, since 1 / new may overflow where they do not
            some = t.name(new > t.smallest, f"some_{label}")
            gain, ratio = select(some, v / new, 0), select(some, d / new, 1)
        t.name(ratio, f"ratio_{label}")
        weight.set(weight.get() * ratio)
        return new, t.name(gain, f"gain_{label}"), ratio

    def body(t: Trace) -> None:
        U, D, w = (Given(t, name) for name in ("factor", "diagonal", "w"))
        weights = [t.variable("left_a", t.field("weight_a")), t.variable("left_b", t.field("weight_b"))]
        with t.loop("j", 0, counter(t, "count"), down=True) as j:
            s = [t.name(w[j], "s_a"), t.name(w[j + n], "s_b")]
            middle, gain_a, ratio_a = pivot(t, t.name(D[j], "d"), s[0], weights[0], "a")
            after, gain_b, ratio_b = pivot(t, middle, s[1], weights[1], "b")
            D[j] = after

            w[j] = t.zero
            w[j + n] = t.zero
            with t.loop("i", 0, j) as i:
                place = strict_start(j) + i
                u, a, b = t.name(U[place], "u"), t.name(w[i], "a"), t.name(w[i + n], "b")
                between = t.name(ratio_a * u + gain_a * a, "u_a")
                w[i] = a - s[0] * u
                w[i + n] = b - s[1] * between
                U[place] = ratio_b * between + gain_b * b

    size = n * (n - 1) // 2
    arguments = [array_argument("factor", size), array_argument("diagonal", n), array_argument("w", 2 * n),
                 number_argument("weight_a"), number_argument("weight_b"), counter_argument("count")]  # fmt: skip
    doc = "U D U^T += weight_a a a^T + weight_b b b^T; w holds a and b, zero from `count` on, and is zeroed"
    return kernels.function("absorb_pair" if sure else "absorb_any_pair", arguments, doc, body)


def take_in(t: Trace, factors: tuple[Given, Given, Given | Array], weight: Variable, count: Value | int) -> None:
    """U D U^T += weight w w^T over the first `count` rows of (U, D, w) (Agee & Turner 1972); uses up weight and w."""
    U, D, w = factors
    with t.loop("j", 0, count, down=True) as j:
        s, d = t.name(w[j], "s"), t.name(D[j], "d")
        v = t.name(weight.get() * s, "v")
        a = t.name(d + s * v, "a")
        some = t.name(a > t.smallest, "some")
        b = t.name(select(some, v / a, 0), "b")
        ratio = t.name(select(some, d / a, 1), "ratio")
        D[j] = a
        with t.loop("i", 0, j) as i:
            place = strict_start(j) + i
            u, w_i = t.name(U[place], "u"), t.name(w[i], "w_i")
            w[i] = w_i - s * u
            U[place] = ratio * u + b * w_i
        weight.set(weight.get() * ratio)


def absorb_one(kernels: Kernels, n: int) -> Function:
    """U D U^T += weight w w^T, as `algebra.rank_one`."""

    def body(t: Trace) -> None:
        U, D, w = (Given(t, name) for name in ("factor", "diagonal", "w"))
        weight = t.variable("left", t.field("weight"))
        take_in(t, (U, D, w), weight, n)

    arguments = [array_argument("factor", n * (n - 1) // 2), array_argument("diagonal", n), array_argument("w", n)]
    arguments.append(number_argument("weight"))
    return kernels.function("absorb", arguments, "U D U^T += weight w w^T; w is used up", body)


def bierman(kernels: Kernels, n: int, single: bool, sure: bool, weighted: bool, moves: bool) -> Function:
    """A scalar measurement (Bierman 1977, V.2; see `algebra.measurement`). single: of one state.

    sure: r is known to be positive. moves: the gain is applied to an innovation at once; else it is handed back.
    """

    def projected(t: Trace, U: Given, j: Value) -> Value:
        """f_j, entry j of U^T h^T."""
        if single:
            state, h = counter(t, "state"), t.field("h")
            seen: Value = select(state < j, h * U[strict_start(j) + state], h)
            return seen
        row, first, last = Given(t, "h"), counter(t, "first"), counter(t, "last")
        product = t.variable("product", row[j])
        with t.loop("i", first, select_counter(j <= last, j, last + 1)) as i:
            product.set(product.get() + U[strict_start(j) + i] * row[i])
        return product.get()

    def body(t: Trace) -> None:
        U, D = Given(t, "factor"), Given(t, "diagonal")
        gain: Given | Array = t.array("gain", n) if moves else Given(t, "gain")
        first = counter(t, "state" if single else "first")
        s = t.variable("sum", t.field("r"))
        latest = t.variable("reciprocal", 0) if moves else s
        with t.loop("i", 0, first) as i:
            gain[i] = t.zero
        with t.loop("j", first, n) as j:
            f = t.name(projected(t, U, j), "f")
            d = t.name(D[j], "d")
            v = t.name(d * f, "v")
            weighed = t.name(t.field("weight") * f, "f_weighed") if weighted else f
            before = t.name(s.get(), "before")
            after = t.name(before + weighed * v, "after")
            s.set(after)
            if sure:
                inverse = t.name(1 / after, "inverse")
                D[j] = d * (before * inverse)
            else:
                some = t.name(after > (t.smallest if single else t.field("least")), "some")
                inverse = t.name(select(some, 1 / after, 0), "inverse")
                D[j] = d * select(some, before * inverse, 1)
            if moves:
                latest.set(inverse)
            b = t.name(v * inverse, "b")
            with t.loop("i", 0, j) as i:
                place = strict_start(j) + i
                k = t.name(gain[i], "k_i")
                u = t.name(U[place] - weighed * k, "u")
                U[place] = u
                gain[i] = k + b * u
            gain[j] = b
        if moves:
            moved = Given(t, "moved")
            with t.loop("i", 0, n) as i:
                moved[i] = moved[i] + gain[i] * t.field("nu")
        Given(t, "s")[0] = s.get()
        if moves:
            Given(t, "s")[1] = t.field("nu") * (t.field("nu") * latest.get())

    size = n * (n - 1) // 2
    arguments = [array_argument("factor", size), array_argument("diagonal", n)]
    if single:
        arguments += [counter_argument("state"), number_argument("h")]
    else:
        arguments += [array_argument("h", n, constant=True), counter_argument("first"), counter_argument("last")]
        arguments += [number_argument("least")] * (not sure)
    arguments += [number_argument("r")] + [number_argument("weight")] * weighted
    arguments += [number_argument("nu"), array_argument("moved", n)] if moves else [array_argument("gain", n)]
    arguments.append(array_argument("s", 2))
    doc = (
        "Bierman's update by a measurement of h times one state, of variance r"
        if single
        else "Bierman's update by a measurement of h x, of variance r; h is zero before `first` and after `last`"
    )
    doc += ". s: its innovation variance" + (", and nu^2 over it; moved += gain nu" if moves else "")
    name = "measure" + "_state" * single + "_gain" * (not moves) + "_any" * (not sure)
    return kernels.function(name, arguments, doc, body)


def carlson(kernels: Kernels, n: int, sure: bool, weighted: bool, moves: bool) -> Function:
    """A scalar measurement of S S^T (Carlson 1973; see `sqrt`). sure, moves: as of `bierman`."""

    def root_of(t: Trace, a: Value) -> tuple[Value, Value]:
        root = t.name(sqrt(a), "root")
        return root, t.name(1 / root if sure else select(root > t.smallest, 1 / root, 0), "inverse")

    def body(t: Trace) -> None:
        S, D, h = (Given(t, name) for name in ("factor", "diagonal", "h"))
        first, last = counter(t, "first"), counter(t, "last")
        b = t.array("b", n)
        with t.loop("i", 0, first) as i:
            b[i] = 0
        s = t.variable("sum", t.field("r"))
        before = t.variable("before", sqrt(s.get()))
        per_before = t.variable("per_before", 0)  # at first it is multiplied by b, which is zero: 1 / 0 would not be
        with t.loop("j", first, n) as j:
            d = t.name(D[j], "d")
            product = t.variable("product", h[j] * d)
            with t.loop("i", first, select_counter(j <= last, j, last + 1)) as i:
                product.set(product.get() + S[strict_start(j) + i] * h[i])
            f = t.name(product.get(), "f")
            weighed = t.name(t.field("weight") * f, "f_weighed") if weighted else f
            after = t.name(s.get() + weighed * f, "after")
            s.set(after)
            root, inverse = root_of(t, after)
            beta = before.get() * inverse
            beta = t.name(beta if sure else select(after > 0, beta, 1), "beta")
            gamma = t.name(weighed * inverse * per_before.get(), "gamma")
            with t.loop("i", 0, j) as i:
                place = strict_start(j) + i
                old, b_i = t.name(S[place], "old"), t.name(b[i], "b_i")
                S[place] = beta * old - gamma * b_i
                b[i] = b_i + f * old
            b[j] = f * d
            D[j] = beta * d
            before.set(root)
            per_before.set(inverse)
        total = t.name(s.get(), "s_all")
        per_s = t.name(1 / total if sure else select(total > t.smallest, 1 / total, 0), "per_s")
        if moves:
            nu, moved = t.field("nu"), Given(t, "moved")
            step = t.name(nu * per_s, "step")
            with t.loop("i", 0, n) as i:
                moved[i] = moved[i] + b[i] * step
            Given(t, "s")[1] = nu * step
        else:
            with t.loop("i", 0, n) as i:
                Given(t, "gain")[i] = b[i] * per_s
        Given(t, "s")[0] = total

    arguments = [array_argument("factor", n * (n - 1) // 2), array_argument("diagonal", n),
                 array_argument("h", n, constant=True), counter_argument("first"), counter_argument("last"),
                 number_argument("r")]  # fmt: skip
    arguments += [number_argument("weight")] * weighted
    arguments += [number_argument("nu"), array_argument("moved", n)] if moves else [array_argument("gain", n)]
    arguments.append(array_argument("s", 2))
    doc = "Carlson's update by a measurement of h x, of variance r; h is zero before `first` and after `last`"
    doc += ". s: its innovation variance" + (", and nu^2 over it; moved += gain nu" if moves else "")
    return kernels.function("measure_root" + "_gain" * (not moves) + "_any" * (not sure), arguments, doc, body)
