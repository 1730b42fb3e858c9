"""The covariance of a bank, in and out: set in every mode, read with the spread between them."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from kfgen.filters.algebra.linalg import Rows, dot, plus, times
from kfgen.filters.algebra.numbers import Number, select
from kfgen.filters.bank.mode import Mode
from kfgen.filters.bank.trace import BankTrace
from kfgen.filters.base import CONST_KF, KF
from kfgen.filters.steps.covariance import covariance_argument
from kfgen.filters.steps.outputs import outputs_function
from kfgen.geometry import heaviest
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model


class BankCovariance:
    """Traces set_covariance, get_covariance and get_outputs. outdated: as in CovarianceCode, of all modes."""

    def __init__(self, model: Model, modes: list[Mode], outdated: tuple[str, ...]) -> None:
        self.model = model
        self.modes = modes
        self.outdated = outdated
        self.n = len(model.states)
        tables: dict[tuple[int, ...], str] = {}
        for mode in modes:  # one table for modes of the same inner order
            code = mode.filter.covariance
            for order in code.constants().values():
                code.table = tables.setdefault(order, f"order_{mode.name}")
        self.tables = tables

    def constants(self) -> dict[str, tuple[int, ...]]:
        return {name: order for order, name in self.tables.items()}

    def functions(self, taken: frozenset[str]) -> list[Function]:
        return [self.set_covariance(taken), self.get_covariance(taken)]

    def set_covariance(self, taken: frozenset[str]) -> Function:
        """P into every mode, after testing it in each of their orders."""
        t = BankTrace()
        read: dict[tuple[int, ...], tuple[Array, Array]] = {}
        for mode in self.modes:
            order = tuple(mode.filter.order)
            if order not in read:
                with t.of(mode.scope()):
                    read[order] = mode.filter.covariance.read(t)
        t.settle()
        t.section("store")
        for mode in self.modes:
            with t.of(mode.scope()):
                mode.filter.form.put(t, *read[tuple(mode.filter.order)])
        for path in self.outdated:
            t.store(path, None, t.wrapped(t.pool.boolean(False)))
        return Function(
            "set_covariance", [KF, covariance_argument(self.n)], schedule(t, taken | {"x", "P"}),
            "Replace the covariance of every mode; their states stay.",
        )  # fmt: skip

    def get_covariance(self, taken: frozenset[str]) -> Function:
        """P = sum of mu_i (P_i + d_i d_i^T), d_i = x_i less the mean of all."""
        t, n = BankTrace(), self.n
        mu = [t.name(t.element("kf.mu", i), f"mu_{mode.name}") for i, mode in enumerate(self.modes)]
        deviations = self._deviations(t, mu)
        t.section("the spread between the modes")
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            total = t.zero
            for m, d in zip(mu, deviations, strict=True):
                total = total + m * (d[i] * d[j])
            t.name(total, "value")
            t.store("P", i * n + j, total)
            t.store("P", j * n + i, total)
        for mode, m in zip(self.modes, mu, strict=True):
            with t.of(mode.scope()):
                t.section("its own")
                code = mode.filter.covariance
                at = code.place(t)
                with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
                    own = t.name(mode.filter.form.get(t, i, j), "value")
                    after = t.name(t.element("P", at(i) * n + at(j)) + m * own, "sum")
                    t.store("P", at(i) * n + at(j), after)
                    t.store("P", at(j) * n + at(i), after)
        out = Argument("P", "{name}_real_t", pointer=True, constant=False, size=n * n, doc="covariance, row-major")
        return Function(
            "get_covariance", [CONST_KF, out], schedule(t, taken | {"x", "P"}),
            "The covariance of the combined state: the modes' own, and their spread.", returns="void",
        )  # fmt: skip

    def isolate(self, t: Trace, variances: Mapping[int, Value]) -> None:
        """As a filter by itself does, in every mode."""
        assert isinstance(t, BankTrace)
        for mode in self.modes:
            with t.of(mode.scope()):
                mode.filter.isolate(t, variances)

    def outputs(self, taken: frozenset[str], smallest: Fraction) -> list[Function]:
        """What tells the outputs, where there are some."""
        if not self.model.outputs:
            return []
        t = BankTrace(smallest)
        return [outputs_function(t, self.model, lambda J: self._variances(t, J), taken)]

    def _variances(self, t: BankTrace, J: Rows) -> list[Number]:
        """The diagonal of J P J^T (k,), of P = sum of mu_i (P_i + d_i d_i^T)."""
        mu = [t.name(t.element("kf.mu", i), f"mu_{mode.name}") for i, mode in enumerate(self.modes)]
        totals: list[Number] = [0] * len(J)
        deviations = self._deviations(t, mu)
        for mode, m, d in zip(self.modes, mu, deviations, strict=True):
            with t.of(mode.scope()):
                own = mode.filter.variances(t, J)
                apart = [dot(row, [d[i] for i in range(self.n)]) for row in J]
                totals = [
                    plus(total, times(m, plus(v, times(a, a)))) for total, v, a in zip(totals, own, apart, strict=True)
                ]
        return totals

    def _deviations(self, t: BankTrace, mu: list[Value]) -> list[Array]:
        """x of each mode less the mean; periodic states about the mode of the largest probability."""
        states, n = self.model.states, self.n
        arrays = []
        x = []
        for mode in self.modes:
            with t.of(mode.scope()):
                arrays.append(t.array("d", n))
                x.append([t.element("kf.x", k) for k in range(n)])
        for k, (name, part) in enumerate(zip(states, self.model.parts, strict=True)):
            base = x[0][k]
            if not part.flat:
                base = t.name(heaviest([own[k] for own in x], mu, select), f"{name}_base")
            d = [part.local(own[k], base) for own in x]
            shift = sum((m * v for m, v in zip(mu[1:], d[1:], strict=True)), mu[0] * d[0])
            t.name(shift, f"shift_{name}")
            for array, v in zip(arrays, d, strict=True):
                array[k] = v - shift
        return arrays
