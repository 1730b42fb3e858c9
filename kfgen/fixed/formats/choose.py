"""Binary points: the value of raw 1 of every cell is 2^e, with e from what runs, ranges and units say.

Interface (fields that the user reads or writes): units from declared ranges, so that the range fits with bits to
spare, or from the runs with more. Inside: from the largest value of the runs with HEADROOM bits above it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from kfgen.filters.base import FilterCode
from kfgen.fixed.program.cells import Arrays, Cell, plain
from kfgen.fixed.program.chains import chained
from kfgen.fixed.ranges.pace import Pace
from kfgen.fixed.ranges.real import Ranges
from kfgen.ir.nodes import Node

BITS = 30  # of the size of a number inside: sums of two then fit an int32_t
OUTSIDE = 31  # of one that the user reads or writes
HEADROOM = 2  # bits above the largest value of the runs
COVARIANCE = 2  # the same for P, which an outage in the runs has driven further than most will
PASSING = 1  # the same for what is not kept
MORE = 2  # further ones where gains depend on the data, so that no run shows their largest values
SPARE = 3  # bits above a declared range, which a filter may overshoot
KEPT = 5  # bits of the process noise of a step
CARRIED = 16  # bits below the LSB that a carried cell has
SLACK = 1.02  # of a run's figures, so that the last digit of a platform's libm decides nothing


def above(value: float) -> int:
    """The least k with value < 2^k; of a run's figure, with slack."""
    return math.frexp(abs(value) * SLACK)[1] if value else -1022


def exponent(value: float, headroom: int, bits: int = BITS) -> int:
    """The e at which value has that many bits of head-room."""
    return above(value) + headroom - bits


@dataclass
class Quantity:
    """One line of the report: what it is, the range that was reckoned with, its LSB's exponent, spare bits."""

    name: str
    largest: float
    e: int
    raised: str = ""
    bits: int = OUTSIDE

    @property
    def headroom(self) -> int:
        """Bits between the largest value and the format's end."""
        return self.e + self.bits - above(self.largest)


@dataclass
class Formats:
    """Cell -> exponent of its LSB; what is not known is looked up in the ranges of the runs."""

    arrays: Arrays
    ranges: Ranges
    bits: int  # n of q<m>.<n>
    more: int = 0  # further head-room
    fixed: dict[Cell, int] = field(default_factory=dict)
    report: list[Quantity] = field(default_factory=list)
    carried: dict[Cell, int] = field(default_factory=dict)  # cells with digits below their LSB -> place in kf.rest

    def of(self, cell: Cell) -> int | None:
        """The exponent of a cell; None where the runs have told nothing."""
        found = self.fixed.get(cell)
        if found is None:
            largest = self.ranges.largest(cell)
            if largest == 0:
                return None
            covariance = cell[0] == "array" and plain(str(cell[1])) in ("kf.D", "kf.P")
            found = self.fixed[cell] = exponent(largest, COVARIANCE if covariance else HEADROOM + self.more)
        return found

    def node(self, node: Node, headroom: int = PASSING) -> int | None:
        """The exponent for the value of a node."""
        largest = self.ranges.largest(node)
        return exponent(largest, headroom + self.more) if largest else None


    def least(self, node: Node) -> int | None:
        """The finest exponent at which the runs' values still fit, with a little to spare."""
        largest = self.ranges.largest(node)
        return exponent(1.25 * largest, self.more) if largest else None


def choose(code: FilterCode, arrays: Arrays, ranges: Ranges, bits: int, scale: Mapping[str, int] | None,
           linear: bool, noise: list[list[float]], pace: Pace) -> Formats:  # fmt: skip
    """The formats of the interface and of the covariance.

    scale: exponents of the states' units, where given. linear: the covariance does not depend on the data.
    noise: what a step adds to each variance (modes, n). pace: what the steps of a run changed.
    """
    formats = Formats(arrays, ranges, bits, 0 if linear else MORE)
    _Interface(code, formats, scale or {}, noise).choose()
    _carry(code, formats, pace)
    return formats


def _carry(code: FilterCode, formats: Formats, pace: Pace) -> None:
    """Find the cells of one filter that change by less than can be rounded away."""
    arrays, states = formats.arrays, code.model.states

    def carry(cell: Cell, name: str) -> None:
        if chained(code.functions, arrays, cell):
            formats.carried[cell] = len(formats.carried)
            for q in formats.report:
                if q.name == name:
                    q.raised = f"{q.raised}, rounding carried on".removeprefix(", ")

    for i in range(len(states)):
        cell = arrays.element(("array", "kf.x"), i)
        if pace.drifts(i, math.ldexp(1.0, formats.fixed[cell])):
            carry(cell, states[i])
    if not pace.moved:
        return
    name = "D" if "kf.D" in pace.moved else "P"
    slow: set[int] = set()
    for diagonal in (True, False) if name == "P" else (True,):  # beside a slow variance, correlations may be slow
        for j in range(len(states)):
            for i in (j,) if diagonal else range(j):
                index = j if name == "D" else j * (j + 1) // 2 + i
                cell = arrays.element(("array", f"kf.{name}"), index)
                e = formats.of(cell)
                if e is None or not (diagonal or {i, j} & slow):
                    continue
                if pace.crawls(f"kf.{name}", index, code.order[j] if diagonal else None, math.ldexp(1.0, e)):
                    slow |= {j} if diagonal else set()
                    carry(cell, f"{name}[{states[code.order[j]]}]" if diagonal else "")


class _Interface:
    def __init__(self, code: FilterCode, formats: Formats, scale: Mapping[str, int],
                 noise: list[list[float]]) -> None:
        self.noise = noise
        self.code = code
        self.f = formats
        self.model = code.model
        self.spec = code.model.spec
        self.scale = scale

    def choose(self) -> None:
        f, spec, n = self.f, self.spec, len(self.model.states)
        x = [self._state(i) for i in range(n)]
        for each in spec.inputs:
            self._quantity(("number", f"u.{each.name}"), each.name, self._limit(each.range), 2)
        for name, value in self.model.parameters:
            given = next(p for p in spec.parameters if p.name == name)
            cell = ("number", f"kf.parameters.{name}")
            f.ranges.see(cell, float(value))
            self._quantity(cell, name, max(self._limit(given.range), abs(float(value))), 4)
        if spec.dt is not None and spec.dt.run_time:
            high = self.model.dt_limits[1]
            f.ranges.see(("number", "dt"), float(high or 0))
            self._quantity(("number", "dt"), "dt", float(high or 0), 4)
        z = {s.name: [self._component(s, k, x) for k in range(len(s.components))] for s in spec.measurements}
        one = -f.bits
        for b, mode in enumerate(self.code.modes):
            f.fixed[f.arrays.element(("array", "kf.mu"), b)] = one
            for i in range(n):
                f.fixed[f.arrays.element(("array", f"kf.modes.{mode.name}.x"), i)] = x[i]
        for name in ("nis", "log_likelihood"):
            f.fixed["number", f"kf.{name}"] = one
        f.fixed["number", "kf.t"] = -12
        for i in range(n):
            self._argument("set_state", "x", i, x[i])
            for j in range(n):
                k = i * n + j
                for function in ("set_covariance", "get_covariance"):
                    self._argument(function, "P", k, x[i] + x[j] + f.bits)
                self._argument("get_Q", "Q", k, x[i] + x[j] + f.bits)
                for function in ("set_sqrt_covariance", "get_sqrt_covariance"):
                    self._argument(function, "S", k, x[i])
        for sensor, e in z.items():
            m = len(e)
            for i in range(m):
                for j in range(m):
                    self._argument(f"get_R_{sensor}", "R", i * m + j, e[i] + e[j] + f.bits)
        self._covariances()

    def _argument(self, function: str, array: str, index: int, e: int) -> None:
        self.f.fixed[self.f.arrays.element(("array", function, array), index)] = e

    def _limit(self, range_: object) -> float:
        if range_ is None:
            return 0.0
        low, high = (self._number(v) for v in range_)  # type: ignore[attr-defined]
        return max(abs(low), abs(high))

    def _number(self, expression: object) -> float:
        from kfgen.spec.constants import value

        return float(value(expression.tree, self.spec))  # type: ignore[attr-defined]

    def _quantity(self, cell: Cell, name: str, declared: float, headroom: int, least: int | None = None,
                  most: str = "") -> int:  # fmt: skip
        seen = self.f.ranges.largest(cell)
        largest = declared or seen
        e = exponent(largest, SPARE if declared else headroom, OUTSIDE) if largest else -self.f.bits
        raised = ""
        if least is not None and least > e:
            e, raised = least, most
        self.f.fixed[cell] = e
        self.f.report.append(Quantity(name, largest, e, raised))
        return e

    def _state(self, i: int) -> int:
        state = self.spec.states[i]
        cell = self.f.arrays.element(("array", "kf.x"), i)
        if state.name in self.scale:
            self.f.fixed[cell] = e = self.scale[state.name] - self.f.bits
            self.f.report.append(Quantity(state.name, self.f.ranges.largest(cell), e, "unit given"))
            return e
        declared = max(self._limit(state.range), self._limit(state.bounds), float(self.model.periods[i] or 0) / 2)
        variance = self._variance(i)
        # P_ii has the LSB 2^(2 e + n) outside, and has to fit there too
        least = math.ceil((above(variance) + 1 - OUTSIDE - self.f.bits) / 2) if variance else None
        if self.model.periods[i] is not None:  # wrapped before it is stored
            self.f.ranges.see(cell, float(self.model.periods[i] or 0) / 2)
        return self._quantity(cell, state.name, declared, HEADROOM + 1, least, "so that its variance fits")

    def _variance(self, i: int) -> float:
        """The largest variance of state i that the runs have met."""
        n = len(self.model.states)
        return self.f.ranges.largest(self.f.arrays.element(("array", "get_covariance", "P"), i * n + i))

    def _component(self, sensor: object, k: int, x: list[int]) -> int:
        c = sensor.components[k]  # type: ignore[attr-defined]
        model = next(s for s in self.model.sensors if s.name == sensor.name)  # type: ignore[attr-defined]
        cell = ("number", f"update_{model.name}", f"z.{c.name}")
        declared = max(self._limit(c.range), float(model.periods[k] or 0) / 2)
        names = list(self.model.states)
        if str(model.h[k]) in names:  # it reads a state: its range is that state's
            i = names.index(str(model.h[k]))
            declared = max(declared, self._limit(self.spec.states[i].range))
        return self._quantity(cell, f"{model.name}.{c.name}", declared, HEADROOM + 1)

    def _covariances(self) -> None:
        if not self.code.modes:
            self._covariance("", self.code.order, self.noise[0])
            return
        for mode, noise in zip(self.code.modes, self.noise, strict=True):
            self._covariance(f"modes.{mode.name}.", mode.order, noise)

    def _covariance(self, place: str, order: tuple[int, ...], noises: list[float]) -> None:
        """P_ij at the mean of P_ii and P_jj, which bound it. place: of the filter in the struct."""
        f, n = self.f, len(self.model.states)
        names = {block.name for block in self.code.blocks}
        fields = {name for name in ("D", "P", "S") if place + name in names}
        for j in range(n):  # head-room gives way to the process noise, which must not be rounded away
            state = order[j]
            index = j if "D" in fields else j * (j + 3) // 2
            cell = f.arrays.element(("array", f"kf.{place}D" if "D" in fields else f"kf.{place}P"), index)
            e, largest, noise = f.of(cell), f.ranges.largest(cell), noises[state]
            if "S" not in fields and e is not None and noise > 0:
                wanted = math.frexp(noise)[1] - 1 - KEPT
                f.fixed[cell] = max(min(e, wanted), exponent(1.05 * largest, 0))
            if e is not None and "S" not in fields:
                name = f"{place}{'D' if 'D' in fields else 'P'}[{self.model.states[state]}]"
                gave = "room given to process noise" if f.fixed[cell] < e else ""
                f.report.append(Quantity(name.removeprefix("modes."), largest, f.fixed[cell], gave, BITS))
        if "P" not in fields:
            return
        diagonal = []
        for j in range(n):
            cell = f.arrays.element(("array", f"kf.{place}P"), j * (j + 3) // 2)
            diagonal.append(f.ranges.largest(cell))
        for j in range(n):
            for i in range(j + 1):
                cell = f.arrays.element(("array", f"kf.{place}P"), j * (j + 1) // 2 + i)
                f.ranges.see(cell, math.sqrt(diagonal[i] * diagonal[j]))
