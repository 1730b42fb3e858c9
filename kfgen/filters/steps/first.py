"""The first measurements of some sensors: what they set in place of an update, and who waits for them.

Where one sensor alone is named, everything goes on meanwhile; of several, nothing else is done until all have come.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import and_

import sympy

from kfgen.filters.algebra.numbers import select
from kfgen.filters.base import Block
from kfgen.filters.frame import guards
from kfgen.filters.steps.compensation import FIELD, Compensation
from kfgen.ir.lower import Lowering
from kfgen.ir.program import Store
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.first import FirstModel
from kfgen.model.model import SensorModel

DONE = "initialized"

Confined = Callable[[Trace, list[Value]], list[Value]]
"""x within its bounds, in its chart."""

Isolating = Callable[[Trace, Mapping[int, Value]], None]
"""Gives errors, by their places in the spec's order, variances of their own, correlated with none."""


class First:
    """Traces what an update does as long as it is the first of its sensor.

    states: the fields that hold x; outdated: as in StateCode. isolating: of the covariances that are kept.
    """

    def __init__(
        self, model: Model, states: Sequence[str], outdated: Sequence[str], confined: Confined,
        isolating: Isolating | None,
    ) -> None:  # fmt: skip
        self.model = model
        self.states = states
        self.outdated = outdated
        self.confined = confined
        self.isolating = isolating

    def blocks(self) -> list[Block]:
        """Fields that tell what has come."""
        firsts = self.model.firsts
        if not firsts:
            return []
        doc = "the first measurement has set the state"
        if not self.model.waits:
            return [Block(DONE, None, doc, kind="bool")]
        several = [Block(f"{DONE}_{rule.sensor}", None, f"that of {rule.sensor}", kind="bool") for rule in firsts]
        return [Block(DONE, None, "the first measurements have set the state", kind="bool"), *several]

    def wait(self, t: Trace, sensor: SensorModel | None = None) -> None:
        """OK as long as others are waited for. sensor: the one that has come."""
        if not self.model.waits:
            return
        rule = None if sensor is None else self.model.first(sensor)
        early = ~_flag(t, DONE)
        t.guard(early if rule is None else early & _flag(t, f"{DONE}_{rule.sensor}"), "OK")

    def takes_inputs(self, sensor: SensorModel) -> bool:
        """Whether the first measurement of a sensor takes u."""
        rule = self.model.first(sensor)
        return rule is not None and bool(rule.uses() & set(self.model.inputs))

    def needed(
        self, t: Trace, sensor: SensorModel, used: Sequence[Value] | None, counts: Mapping[str, Value], read: set[str]
    ) -> dict[str, Value]:
        """Path of what a caller sets -> whether it counts, with what only the first measurement reads.

        counts: the same for the update, of what does not always count for that; read: names that it reads.
        """
        rule, out = self.model.first(sensor), dict(counts)
        if rule is None:
            return out
        opens = self._opens(t, rule, sensor, used)
        known = {name: f"u.{name}" for name in self.model.inputs}
        known |= {name: f"z.{name}" for name in sensor.inputs}
        known |= {name: f"kf.parameters.{name}" for name, _ in self.model.parameters}
        for name in sorted(rule.uses()):
            path = known[name]
            if path in out:
                out[path] = out[path] | opens
            elif name not in read:
                out[path] = opens
        return out

    def run(self, t: Trace, sensor: SensorModel, used: Sequence[Value] | None) -> None:
        """The first complete measurement of a sensor sets states and variances, and ends the update.

        used: whether each component counts, where a mask tells.
        """
        rule = self.model.first(sensor)
        if rule is None:
            return
        t.section("the first measurement sets the state")
        if rule.plain:
            self._plain(t, rule, sensor, used)
            return
        with t.when(self._opens(t, rule, sensor, used)):
            self._set(t, rule, sensor, used)
        if rule.waits and used is not None:
            t.guard(~_flag(t, DONE), "OK")  # with too few components to begin

    def _opens(self, t: Trace, rule: FirstModel, sensor: SensorModel, used: Sequence[Value] | None) -> Value:
        """Whether the measurement is the first, and has what is asked of it."""
        open_ = ~_flag(t, f"{DONE}_{rule.sensor}" if self.model.waits else DONE)
        if used is None:
            return open_
        names = [c.name for c in sensor.spec.components]
        return reduce(and_, [used[names.index(c)] for c in rule.components], open_)

    def _plain(self, t: Trace, rule: FirstModel, sensor: SensorModel, used: Sequence[Value] | None) -> None:
        """States that are components."""
        done = _flag(t, DONE)
        readings = [t.field(f"z.{c.name}") for c in sensor.spec.components]
        if used is not None:
            names = [c.name for c in sensor.spec.components]
            for component in rule.states.values():
                done = done | ~used[names.index(component.name)]
            readings = [select(u, z, t.zero) for u, z in zip(used, readings, strict=True)]
        t.guard(~t.finite(sum(readings[1:], readings[0])), "NOT_FINITE")
        states = self.model.states
        x = [t.field(f"z.{rule.states[s].name}") if s in rule.states else t.zero for s in states]
        x = self.confined(t, x)
        set_here = [i for i, s in enumerate(states) if s in rule.states]
        stores = [Store(path, t.pool.integer(i), x[i].node) for path in self.states for i in set_here]
        stores.append(Store("kf.nis", None, t.pool.zero))
        stores.append(Store(f"kf.{DONE}", None, t.pool.boolean(True)))
        stores += [Store(path, None, t.pool.boolean(False)) for path in self.outdated]
        second = Compensation(self.model).place
        stores += [Store(f"kf.{FIELD}", t.pool.integer(second[i]), t.pool.zero) for i in set_here if i in second]
        t.guard(~done, "OK", before=stores)

    def _set(self, t: Trace, rule: FirstModel, sensor: SensorModel, used: Sequence[Value] | None) -> None:
        """What is computed of the measurement, tested and stored."""
        model = self.model
        lowering = self._lowering(t, rule, sensor)
        wanted = [t.name(lowering(e), f"{name}_first") for name, e in rule.states.items()]
        variances = [t.name(lowering(e), f"var_{name}_first") for name, e in rule.variances.items()]
        readings = [t.field(f"z.{c.name}") for c in sensor.spec.components]
        if used is not None:
            readings = [select(u, z, t.zero) for u, z in zip(used, readings, strict=True)]
        for value in (*readings, *wanted, *variances):  # one by one: the sum of large numbers would overflow
            if value.constant is None:
                t.guard(~t.finite(value), "NOT_FINITE")
        guards.positive(t, [value < 0 for value in variances])
        given = dict(zip(rule.states, wanted, strict=True))
        x = self.confined(t, [given.get(name, t.zero) for name in model.states])
        second = Compensation(model).place
        for i, name in enumerate(model.states):
            if name not in given:
                continue
            for path in self.states:
                t.store(path, i, x[i])
            if i in second:
                t.store(f"kf.{FIELD}", second[i], t.zero)
        if variances:
            assert self.isolating is not None
            places = [model.states.index(name) for name in rule.variances]
            self.isolating(t, dict(zip(places, variances, strict=True)))
        true = t.wrapped(t.pool.boolean(True))
        for path in self.outdated:
            t.store(path, None, ~true)
        t.store("kf.nis", None, t.zero)
        done = true
        if model.waits:
            t.store(f"kf.{DONE}_{rule.sensor}", None, true)
            others = [_flag(t, f"{DONE}_{other.sensor}") for other in model.firsts if other.sensor != rule.sensor]
            done = reduce(and_, others, true)
        t.store(f"kf.{DONE}", None, done)
        t.guard(true, "OK")

    def _lowering(self, t: Trace, rule: FirstModel, sensor: SensorModel) -> Lowering:
        """Of formulas of a measurement; components hide what else has their names."""
        model = self.model
        values = {sympy.Symbol(name): t.field(f"kf.parameters.{name}") for name, _ in model.parameters}
        values |= {sympy.Symbol(name): t.field(f"u.{name}") for name in model.inputs}
        values |= {sympy.Symbol(each.name): t.field(f"z.{each.name}") for each in sensor.spec.fields}
        lowering = Lowering(t, values)
        for name, value in rule.definitions:
            lowering.memo[sympy.Symbol(name)] = t.name(lowering(value), name)
        return lowering


def _flag(t: Trace, name: str) -> Value:
    return t.wrapped(t.pool.make("field", (), f"kf.{name}", "bool"))
