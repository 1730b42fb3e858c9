"""The covariance of a filter, in and out, as loops: rare calls, where size counts and speed does not."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from kfgen.filters.algebra.numbers import select
from kfgen.filters.algebra.triangles import upper_start
from kfgen.filters.base import CONST_KF, KF, Block
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.kept import Kept
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model


class CovarianceCode:
    """Traces set_covariance, get_covariance and their like for a form of the covariance."""

    def __init__(self, model: Model, form: Form[Any], epsilon: Fraction, outdated: str = "") -> None:
        """outdated: a field that says whether something belongs to the present covariance, false when that is set."""
        self.outdated = outdated
        self.table = "order"  # the name of the table that holds the inner order
        self.model = model
        self.form = form
        self.order = form.order
        self.epsilon = epsilon
        self.n = form.n

    def blocks(self) -> tuple[Block, ...]:
        """The fields that hold it, at P0."""
        P0 = self.model.P0
        names = [self.model.errors[i] for i in self.order]
        return tuple(self.form.named(self.form.blocks([[P0[i][j] for j in self.order] for i in self.order], names)))

    def functions(self, taken: frozenset[str]) -> list[Function]:
        """The covariance in and out."""
        return [self.set_covariance(taken), self.get_covariance(taken), *self.form.functions(taken, self.outdated)]

    def constants(self) -> dict[str, tuple[int, ...]]:
        """The inner order, where a table is needed for it, and what the form looks up."""
        straight = list(range(self.n))
        order = {} if self.order in (straight, straight[::-1]) else {self.table: tuple(self.order)}
        return {**order, **self.form.tables}

    def place(self, t: Trace) -> Callable[[Value], Value]:
        """From an inner position, a loop's counter, to the state of the spec."""
        if self.order == list(range(self.n)):
            return lambda i: i
        if self.order == list(reversed(range(self.n))):
            return lambda i: (self.n - 1) - i
        return lambda i: t.wrapped(t.pool.make("element", (i.node,), f"{self.model.spec.name}_{self.table}", "int"))

    def get_covariance(self, taken: frozenset[str]) -> Function:
        """P, row-major, in the spec's order."""
        doc = "The covariance of the state, in the order of the states."
        return get_matrix("covariance", "P", self.n, self.form.get, self.place, doc, taken)

    def get_noise(self, kept: Kept, taken: frozenset[str]) -> Function:
        """The adapted Q, row-major, in the spec's order."""
        doc = "The additive process noise as it has been adapted, in the order of the states."
        return get_matrix("Q", "Q", self.n, kept.get, self.place, doc, taken)

    def set_covariance(self, taken: frozenset[str]) -> Function:
        """Replace P after testing that it is positive semidefinite."""
        t = Trace()
        P, W = self.read(t)
        t.section("store")
        self.form.put(t, P, W)
        if self.outdated:
            t.store(self.outdated, None, t.wrapped(t.pool.boolean(False)))
        return Function(
            "set_covariance",
            [KF, covariance_argument(self.n)],
            schedule(t, taken | {"x", "P"}),
            "Replace the covariance; the state stays.",
        )

    def read(self, t: Trace) -> tuple[Array, Array]:
        """The argument P in the inner order, and its factors, tested: upper triangles column by column."""
        n = self.n
        place = self.place(t)
        size = n * (n + 1) // 2
        P, W = t.array("p", size), t.array("w", size)
        t.section("the upper triangle, column by column")
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            a, b = place(i), place(j)
            low, high = select(b < a, b, a), select(b < a, a, b)
            if self.order == list(range(n)):
                low, high = a, b
            elif self.order == list(reversed(range(n))):
                low, high = b, a
            value = t.name(t.element("P", low * n + high), "value")
            k = upper_start(j) + i
            P[k] = value
            W[k] = value
            t.guard(~t.finite(value), "NOT_FINITE")
        t.section("factor it: a pivot is zero up to round-off, or positive")
        self._factor(t, P, W)
        return P, W

    def _factor(self, t: Trace, P: Array, W: Array) -> None:
        """W: from the packed upper triangle of P to D on the diagonal and U above (Bierman 1977, III.4).

        A pivot within n eps P_jj of zero counts as zero; what is left in its column must then be round-off too.
        """
        n = self.n
        tolerance = n * self.epsilon
        with t.loop("j", 0, n, down=True) as j:
            jj = upper_start(j)
            scale = t.name(P[jj + j] * tolerance, "round_off")
            pivot = t.name(W[jj + j], "pivot")
            t.guard(~(pivot >= -scale), "NOT_POSITIVE")
            d = t.name(select(pivot > scale, pivot, 0), "d")
            W[jj + j] = d
            with t.loop("i", 0, j, down=True) as i:  # what is above i in column j is still P's
                rest = t.name(W[jj + i], "rest")
                allowed = 4 * scale * P[upper_start(i) + i]
                t.guard((d <= 0) & (rest * rest > allowed), "NOT_POSITIVE")
                u = t.name(select(d > 0, rest / d, 0), "u")
                with t.loop("k", 0, i + 1) as k:
                    spot = upper_start(i) + k
                    W[spot] = W[spot] - u * W[jj + k]
                W[jj + i] = u


def covariance_argument(n: int) -> Argument:
    doc = "covariance, row-major; the upper triangle is read"
    return Argument("P", "{name}_real_t", pointer=True, size=n * n, doc=doc)


def get_matrix(
    name: str,
    argument: str,
    n: int,
    entry: Callable[[Trace, Value, Value], Value],
    place: Callable[[Trace], Callable[[Value], Value]],
    doc: str,
    taken: frozenset[str],
) -> Function:
    """A getter of a symmetric matrix (n, n), row-major. entry: for counters i <= j; place: where a row goes."""
    t = Trace()
    at = place(t)
    with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
        value = t.name(entry(t, i, j), "value")
        t.store(argument, at(i) * n + at(j), value)
        t.store(argument, at(j) * n + at(i), value)
    out = Argument(argument, "{name}_real_t", pointer=True, constant=False, size=n * n, doc=f"{name}, row-major")
    return Function(f"get_{name}", [CONST_KF, out], schedule(t, taken | {"x", argument}), doc, returns="void")
