"""Binary points of what the user reads or writes: states, inputs, parameters, readings, and all their covariances.

From declared ranges, so that the range fits with bits to spare, or from the runs with more.
"""

from __future__ import annotations

import math

from kfgen.filters.base import FilterCode
from kfgen.filters.steps.outputs import DEVIATION, FUNCTION, VALUE
from kfgen.fixed.arithmetic.limits import OUTSIDE
from kfgen.fixed.arithmetic.rounding import size_of
from kfgen.fixed.formats.formats import HEADROOM, Formats, Quantity, above, exponent
from kfgen.fixed.program.cells import Cell
from kfgen.fixed.ranges.declared import limits
from kfgen.model.model import SensorModel
from kfgen.spec.constants import value
from kfgen.spec.types import Range

HALF_TURN = math.pi  # no error of a rotation is larger
SPARE = 3  # bits above a declared range, which a filter may overshoot


def error_cell(name: str) -> Cell:
    """Stands for an error coordinate of a rotation, which no array holds."""
    return ("error", name)


class Interface:
    """Chooses the formats of one filter's interface."""

    def __init__(self, code: FilterCode, formats: Formats) -> None:
        self.code = code
        self.f = formats
        self.model = code.model
        self.spec = code.model.spec
        given = self.spec.fixed.scale or {}  # state -> its unit, of which the exponent is taken
        self.scale = {name: size_of(value(e.tree, self.spec)) - 1 for name, e in given.items()}

    def choose(self) -> None:
        f, spec, n = self.f, self.spec, len(self.model.states)
        x = [self._state(i) for i in range(n)]
        errors = [self._error(j) if i is None else x[i] for j, i in enumerate(self.model.space.numbers_of)]
        for each in spec.inputs:
            self._quantity(("number", f"u.{each.name}"), each.name, self._limit(each.range), 2)
        for name, number in self.model.parameters:
            given = next(p for p in spec.parameters if p.name == name)
            cell = ("number", f"kf.parameters.{name}")
            f.ranges.see(cell, float(number))
            self._quantity(cell, name, max(self._limit(given.range), abs(float(number))), 4)
        if spec.dt is not None and spec.dt.run_time:
            high = self.model.dt_limits[1]
            f.ranges.see(("number", "dt"), float(high or 0))
            self._quantity(("number", "dt"), "dt", float(high or 0), 4)
        z = {s.name: self._innovation(s, [self._component(s, k) for k in range(len(s.h))]) for s in self.model.sensors}
        for s in self.model.sensors:
            for each in s.spec.inputs:
                own = ("number", f"update_{s.name}", f"z.{each.name}")
                self._quantity(own, f"{s.name}.{each.name}", self._limit(each.range), 2)
        for output in self.model.outputs:
            self._output(output.name)
        one = -f.bits
        for b, mode in enumerate(self.code.modes):
            f.fixed[f.arrays.element(("array", "kf.mu"), b)] = one
            f.fixed["number", f"kf.modes.{mode.name}.nis"] = one
            for i in range(n):
                f.fixed[f.arrays.element(("array", f"kf.modes.{mode.name}.x"), i)] = x[i]
        for name in ("nis", "log_likelihood"):
            f.fixed["number", f"kf.{name}"] = one
        f.fixed["number", "kf.t"] = -12
        for i in range(n):
            self._argument("set_state", "x", i, x[i])
        self._arguments(errors, z)

    def _output(self, name: str) -> None:
        """Of an output and its standard deviation, which share a format."""
        value, deviation = (("number", FUNCTION, f"{argument}.{name}") for argument in (VALUE, DEVIATION))
        self.f.ranges.see(value, self.f.ranges.largest(deviation))
        self.f.fixed[deviation] = self._quantity(value, name, 0.0, HEADROOM + 1)

    def _arguments(self, x: list[int], z: dict[str, list[int]]) -> None:
        """Of the matrices that functions take or give. x, z: exponents of the errors, of states and of each sensor."""
        f, n = self.f, len(x)
        for i in range(n):
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

    def _argument(self, function: str, array: str, index: int, e: int) -> None:
        self.f.fixed[self.f.arrays.element(("array", function, array), index)] = e

    def _limit(self, declared: Range | None) -> float:
        """The largest size in a range; 0 where there is none."""
        return 0.0 if declared is None else max(map(abs, limits(declared, self.spec)))

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
        cell = self.f.arrays.state(i)
        if state.name in self.scale:
            self.f.fixed[cell] = e = self.scale[state.name] - self.f.bits
            self.f.report.append(Quantity(state.name, self.f.ranges.largest(cell), e, "unit given"))
            return e
        declared = max(self._limit(state.range), self._limit(state.bounds), float(self.model.periods[i] or 0) / 2)
        error = self.model.space.errors_of[i]
        if error is None:  # a number of a unit quaternion
            return self._quantity(cell, state.name, 1.0, 0)
        variance = self._variance(error)
        # P_ii has the LSB 2^(2 e + n) outside, and has to fit there too
        # where gains depend on the data, so do variances; those of a bank grow with what its modes differ by
        room = 1 + (self.f.more if self.code.modes else self.f.spare)
        least = math.ceil((above(variance) + room - OUTSIDE - self.f.bits) / 2) if variance else None
        if self.model.periods[i] is not None:  # wrapped before it is stored
            self.f.ranges.see(cell, float(self.model.periods[i] or 0) / 2)
        return self._quantity(cell, state.name, declared, HEADROOM + 1, least, "so that its variance fits")

    def _error(self, j: int) -> int:
        """Of an error of a rotation: no more than half a turn."""
        name, variance = self.model.errors[j], self._variance(j)
        room = 1 + (self.f.more if self.f.spare or self.code.modes else 0)
        least = math.ceil((above(variance) + room - OUTSIDE - self.f.bits) / 2) if variance else None
        return self._quantity(error_cell(name), name, HALF_TURN, 0, least, "so that its variance fits")

    def _innovation(self, model: SensorModel, z: list[int]) -> list[int]:
        """From the exponents of components to those of an innovation's entries."""
        out = [z[i] for i, _, _ in model.space.singles]
        for r in model.rotations:
            out[r.first_error : r.first_error] = [
                self._quantity(error_cell(f"{model.name}.{name}"), f"{model.name}.{name}", HALF_TURN, 0)
                for name in r.errors
            ]
        return out

    def _variance(self, j: int) -> float:
        """The largest variance of error j that the runs have met."""
        return self.f.ranges.largest(self.f.arrays.variance(j, len(self.model.errors)))

    def _component(self, model: SensorModel, k: int) -> int:
        c = model.spec.components[k]
        cell = ("number", f"update_{model.name}", f"z.{c.name}")
        declared = max(self._limit(c.range), float(model.periods[k] or 0) / 2)
        if model.space.errors_of[k] is None:
            declared = declared or 1.0
        names = list(self.model.states)
        least, most = None, ""
        if str(model.h[k]) in names:  # it reads a state: its range is that state's
            i = names.index(str(model.h[k]))
            declared = max(declared, self._limit(self.spec.states[i].range))
            if self.code.modes and not declared:
                least, most = self.f.fixed[self.f.arrays.state(i)], "as the state that it reads"
        return self._quantity(cell, f"{model.name}.{c.name}", declared, HEADROOM + 1, least, most)
