"""What every filter over one state vector shares: storage, init, set_state, covariance in and out."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.filters.base import CONST_KF, KF, Block
from kfgen.filters.layout import Layout
from kfgen.filters.numbers import select
from kfgen.filters.ud import column
from kfgen.ir.program import Argument, Function, Store
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel


def counts_gated(model: Model, sensor: SensorModel) -> bool:
    """Whether the filter counts the sensor's rejections: where it is asked to, or has to."""
    gate = sensor.spec.gate
    return gate is not None and (model.spec.code.gate_count or gate.reset_after is not None)


class StateCode:
    """Traces the functions that do not depend on the algorithm."""

    def __init__(self, model: Model, layout: Layout, order: list[int], epsilon: Fraction) -> None:
        self.model = model
        self.layout = layout
        self.order = order
        self.epsilon = epsilon
        self.n = len(order)

    def blocks(self) -> list[Block]:
        """The fields of the struct, in order."""
        model = self.model
        P0 = [[model.P0[i][j] for j in self.order] for i in self.order]
        x0 = tuple(_wrapped(v, period) for v, period in zip(model.x0, model.periods, strict=True))
        out = [Block("x", self.n, "state", initial=x0)]
        out += self.layout.blocks(P0)
        out.append(Block("nis", None, "normalised innovation squared of the last update"))
        for sensor in model.sensors:
            if counts_gated(model, sensor):
                doc = f"measurements of {sensor.name} refused in a row"
                out.append(Block(f"gate_count_{sensor.name}", None, doc, kind="uint32"))
        if model.spec.code.log_likelihood:
            out.append(Block("log_likelihood", None, "of the last update"))
        if model.uses_time():
            if model.dt is not None or model.spec.dt is None:
                out.append(Block("steps", None, "predictions since init", kind="uint32"))
            else:
                out.append(Block("t", None, "time since init [s]"))
                out.append(Block("t_lost", None, "what the sum of t has rounded away [s]"))
        if model.spec.initialize is not None:
            out.append(Block("initialized", None, "the first measurement has set the state", kind="bool"))
        return out

    def confined(self, t: Trace, x: list[Value]) -> list[Value]:
        """x within its bounds, angles wrapped. Spec's order."""
        out = []
        for value, bounds, period, name in zip(
            x, self.model.bounds, self.model.periods, self.model.states, strict=True
        ):
            if bounds is not None:
                low, high = t.value(bounds[0]), t.value(bounds[1])
                value = t.name(value, f"{name}_free") if value.constant is None else value
                value = select(value < low, low, select(value > high, high, value))
            if period is not None and value.constant is None:
                value = t.wrap(value, period)
            out.append(value)
        return out

    def initialize(self, t: Trace, sensor: SensorModel) -> None:
        """The first complete measurement of the sensor named in `initialize` sets the state and ends the update."""
        start = self.model.spec.initialize
        if start is None or start.sensor != sensor.name:
            return
        t.section("the first measurement sets the state")
        done = t.wrapped(t.pool.make("field", (), "kf.initialized", "bool"))
        readings = [t.field(f"z.{c.name}") for c in sensor.spec.components]
        t.guard(~t.finite(sum(readings[1:], readings[0])), "NOT_FINITE")
        x = [t.field(f"z.{start.states[s]}") if s in start.states else t.zero for s in self.model.states]
        x = self.confined(t, x)
        stores = [
            Store("kf.x", t.pool.integer(i), x[i].node) for i, s in enumerate(self.model.states) if s in start.states
        ]
        stores.append(Store("kf.nis", None, t.pool.zero))
        stores.append(Store("kf.initialized", None, t.pool.boolean(True)))
        t.guard(~done, "OK", before=stores)

    # functions ---------------------------------------------------------------------------------------

    def init(self, taken: frozenset[str]) -> Function:
        """Set everything to the values of the spec."""
        t = Trace()
        for block in self.blocks():
            if block.size is None:
                zero = {
                    "real": t.zero,
                    "uint32": t.wrapped(t.pool.integer(0)),
                    "bool": t.wrapped(t.pool.boolean(False)),
                }
                t.store(f"kf.{block.name}", None, zero[block.kind])
                continue
            _store_runs(t, block)
        for name, value in self.model.parameters:
            t.store(f"kf.parameters.{name}", None, t.value(value))
        return Function(
            "init",
            [KF],
            schedule(t, taken | {"x", "P"}),
            "Set the state, its covariance and the parameters to their initial values.",
        )

    def set_state(self, taken: frozenset[str]) -> Function:
        """Replace x; the covariance stays."""
        t = Trace()
        given = [t.element("x", i) for i in range(self.n)]
        for value in given:  # one by one: the sum of large numbers would overflow
            t.guard(~t.finite(value), "NOT_FINITE")
        x = [v if p is None else t.wrap(v, p) for v, p in zip(given, self.model.periods, strict=True)]
        for i, value in enumerate(x):
            t.store("kf.x", i, value)
        argument = Argument("x", "{name}_real_t", pointer=True, size=self.n, doc="new state")
        return Function(
            "set_state",
            [KF, argument],
            schedule(t, taken | {"x", "P"}),
            "Replace the state; angles are wrapped, the covariance stays.",
        )

    def _place(self, t: Trace) -> Callable[[Value], Value]:
        """From an inner position to the state of the spec."""
        if self.order == list(range(self.n)):
            return lambda i: i
        return lambda i: t.wrapped(t.pool.make("element", (i.node,), f"{self.model.spec.name}_order", "int"))

    def get_covariance(self, taken: frozenset[str]) -> Function:
        """P, row-major, in the spec's order."""
        t, n = Trace(), self.n
        place = self._place(t)
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            value = t.name(self.layout.get(t, i, j), "p")
            t.store("P", place(i) * n + place(j), value)
            t.store("P", place(j) * n + place(i), value)
        argument = Argument("P", "{name}_real_t", pointer=True, constant=False, size=n * n, doc="covariance, row-major")
        return Function(
            "get_covariance",
            [CONST_KF, argument],
            schedule(t, taken | {"x", "P"}),
            "The covariance of the state, in the order of the states.",
            returns="void",
        )

    def set_covariance(self, taken: frozenset[str]) -> Function:
        """Replace P after testing that it is positive semidefinite."""
        t, n = Trace(), self.n
        place = self._place(t)
        size = n * (n + 1) // 2
        P, W = t.array("p", size), t.array("w", size)
        t.section("the upper triangle, column by column")
        with t.loop("j", 0, n) as j, t.loop("i", 0, j + 1) as i:
            a, b = place(i), place(j)
            low, high = select(b < a, b, a), select(b < a, a, b)
            if self.order == list(range(n)):
                low, high = a, b
            value = t.name(t.element("P", low * n + high), "value")
            k = column(j) + i
            P[k] = value
            W[k] = value
            t.guard(~t.finite(value), "NOT_FINITE")
        t.section("factor it: a pivot is zero up to round-off, or positive")
        self._factor(t, P, W)
        t.section("store")
        self.layout.put(t, P, W)
        argument = Argument(
            "P",
            "{name}_real_t",
            pointer=True,
            size=n * n,
            doc="covariance, row-major; the upper triangle is read",
        )
        return Function(
            "set_covariance",
            [KF, argument],
            schedule(t, taken | {"x", "P"}),
            "Replace the covariance; the state stays.",
        )

    def _factor(self, t: Trace, P: Array, W: Array) -> None:
        """W: from the packed upper triangle of P to D on the diagonal and U above (Bierman 1977, III.4).

        A pivot within n eps P_jj of zero counts as zero; what is left in its column must then be round-off too.
        """
        n = self.n
        tolerance = n * self.epsilon
        with t.loop("j", 0, n, down=True) as j:
            jj = column(j)
            scale = t.name(P[jj + j] * tolerance, "round_off")
            pivot = t.name(W[jj + j], "pivot")
            t.guard(pivot < -scale, "NOT_POSITIVE")
            d = t.name(select(pivot > scale, pivot, 0), "d")
            W[jj + j] = d
            with t.loop("i", 0, j, down=True) as i:  # what is above i in column j is still P's
                rest = t.name(W[jj + i], "rest")
                allowed = 4 * scale * P[column(i) + i]
                t.guard((d <= 0) & (rest * rest > allowed), "NOT_POSITIVE")
                u = t.name(select(d > 0, rest / d, 0), "u")
                with t.loop("k", 0, i + 1) as k:
                    spot = column(i) + k
                    W[spot] = W[spot] - u * W[jj + k]
                W[jj + i] = u


def _store_runs(t: Trace, block: Block) -> None:
    """Constants of an array: equal neighbours in a loop, the others one by one."""
    values = block.initial
    start = 0
    while start < len(values):
        stop = start
        while stop < len(values) and values[stop] == values[start]:
            stop += 1
        if stop - start >= 4:
            with t.loop("i", start, stop) as counter:
                t.store(f"kf.{block.name}", counter, t.value(values[start]))
        else:
            for position in range(start, stop):
                t.store(f"kf.{block.name}", position, t.value(values[position]))
        start = stop


def _wrapped(value: Fraction, period: Fraction | None) -> Fraction:
    """value in (-period/2, period/2]."""
    if period is None:
        return value
    turns = (value / period - Fraction(1, 2)).__ceil__()
    return value - turns * period
