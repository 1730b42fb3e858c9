"""What every filter over one state vector shares: storage, init, set_state, covariance in and out."""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.filters.algebra.numbers import select
from kfgen.filters.base import KF, Block
from kfgen.filters.frame.runs import put
from kfgen.filters.steps.compensation import FIELD, Compensation
from kfgen.ir.program import Argument, Function, Store
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel

NIS = Block("nis", None, "normalised innovation squared of the last update")


def counts_gated(model: Model, sensors: Sequence[SensorModel]) -> bool:
    """Whether the filter counts a sensor's rejections: where it is asked to, or has to.

    sensors: the sensor as each mode of a bank has it.
    """
    gates = [sensor.spec.gate for sensor in sensors if sensor.spec.gate is not None]
    return any(model.spec.code.gate_count or gate.reset_after is not None for gate in gates)


class StateCode:
    """Traces the functions that do not depend on the algorithm."""

    def __init__(
        self,
        model: Model,
        covariance: tuple[Block, ...],
        extra: tuple[Block, ...] = (),
        outdated: tuple[str, ...] = (),
        states: tuple[str, ...] = ("kf.x",),
        sensors: Sequence[Sequence[SensorModel]] | None = None,
    ) -> None:
        """covariance: the fields that hold it; extra: what else the algorithm keeps. states: the fields that hold x.

        outdated: fields that say whether something of it belongs to the present state, false when that is set.
        sensors: each as every mode of a bank has it.
        """
        self.sensors = [(sensor,) for sensor in model.sensors] if sensors is None else sensors
        self.outdated = outdated
        self.states = states
        self.model = model
        self.covariance = covariance
        self.extra = extra
        self.n = len(model.states)

    def blocks(self) -> list[Block]:
        """The fields of the struct, in order."""
        model = self.model
        x0 = tuple(part.placed(v) for v, part in zip(model.x0, model.parts, strict=True))
        out = [Block("x", self.n, "state", initial=x0)]
        out += self.covariance
        out.append(NIS)
        for every in self.sensors:
            if counts_gated(model, every):
                doc = f"measurements of {every[0].name} refused in a row"
                out.append(Block(f"gate_count_{every[0].name}", None, doc, kind="uint32"))
        if model.spec.code.log_likelihood:
            out.append(Block("log_likelihood", None, "of the last update"))
        out += self.extra
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
        for value, bounds, part, name in zip(x, self.model.bounds, self.model.parts, self.model.states, strict=True):
            if bounds is not None:
                low, high = t.value(bounds[0]), t.value(bounds[1])
                value = t.name(value, f"{name}_free") if value.constant is None else value
                value = select(value < low, low, select(value > high, high, value))
            out.append(part.placed(value))
        return out

    def initialize(self, t: Trace, sensor: SensorModel, used: list[Value] | None) -> None:
        """The first complete measurement of the sensor named in `initialize` sets the state and ends the update.

        used: whether each component counts, where a mask tells.
        """
        start = self.model.spec.initialize
        if start is None or start.sensor != sensor.name:
            return
        t.section("the first measurement sets the state")
        done = t.wrapped(t.pool.make("field", (), "kf.initialized", "bool"))
        readings = [t.field(f"z.{c.name}") for c in sensor.spec.components]
        if used is not None:
            names = [c.name for c in sensor.spec.components]
            for component in start.states.values():
                done = done | ~used[names.index(component)]
            readings = [select(u, z, t.zero) for u, z in zip(used, readings, strict=True)]
        t.guard(~t.finite(sum(readings[1:], readings[0])), "NOT_FINITE")
        x = [t.field(f"z.{start.states[s]}") if s in start.states else t.zero for s in self.model.states]
        x = self.confined(t, x)
        set_here = [i for i, s in enumerate(self.model.states) if s in start.states]
        stores = [Store(path, t.pool.integer(i), x[i].node) for path in self.states for i in set_here]
        stores.append(Store("kf.nis", None, t.pool.zero))
        stores.append(Store("kf.initialized", None, t.pool.boolean(True)))
        stores += [Store(path, None, t.pool.boolean(False)) for path in self.outdated]
        second = Compensation(self.model).place
        stores += [Store(f"kf.{FIELD}", t.pool.integer(second[i]), t.pool.zero) for i in set_here if i in second]
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
        x = [part.placed(v) for v, part in zip(given, self.model.parts, strict=True)]
        for path in self.states:
            for i, value in enumerate(x):
                t.store(path, i, value)
        for path in self.outdated:
            t.store(path, None, t.wrapped(t.pool.boolean(False)))
        Compensation(self.model).clear(t)
        argument = Argument("x", "{name}_real_t", pointer=True, size=self.n, doc="new state")
        return Function(
            "set_state",
            [KF, argument],
            schedule(t, taken | {"x", "P"}),
            "Replace the state; angles are wrapped, the covariance stays.",
        )


def _store_runs(t: Trace, block: Block) -> None:
    """Constants of an array: equal neighbours in a loop, the others one by one."""
    values = block.initial
    if block.compact:
        put(t, lambda i, value: t.store(f"kf.{block.name}", i, value), [t.value(v) for v in values])
        return
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
