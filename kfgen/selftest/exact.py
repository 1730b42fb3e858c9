"""What a fixed-point filter has to answer along a track, to the bit: its program, interpreted."""

from __future__ import annotations

import numpy as np

from kfgen.emit.declarations import Declarations
from kfgen.errors import KfgenError
from kfgen.filters.base import FilterCode
from kfgen.filters.steps.outputs import DEVIATION, FUNCTION, VALUE
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.ir import interpret
from kfgen.native.values import Units, value_of
from kfgen.selftest.record import Record
from kfgen.selftest.track import Track
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

_ALONE = int(Status.GATED)
"""With it, as with an error, nothing else is told: what was computed before is not stored."""


class Twin:
    """A fixed-point filter as its program is interpreted: what the compiled C holds and returns, bit for bit."""

    def __init__(self, code: FilterCode, scalar: Fixed) -> None:
        self.scalar = scalar
        self.memory = interpret.Memory()
        self._functions = {each.name: each for each in code.functions}
        self.spec = spec = code.model.spec
        self.memory.arrays["P"] = [0] * len(spec.states) ** 2
        for name, indices in code.constants.items():
            self.memory.arrays[f"{spec.name}_{name}"] = list(indices)
        for block in code.blocks:
            if block.size is None:
                self.memory.numbers[f"kf.{block.name}"] = False if block.kind == "bool" else 0
            else:
                self.memory.arrays[f"kf.{block.name}"] = [0] * block.size

    def call(self, function: str) -> int:
        """The status of a function, its arguments being in the memory."""
        self.scalar.status.bits = 0
        flags = interpret.run(self._functions[function], self.scalar, self.memory)
        status = sum(int(Status[flag]) for flag in flags)
        return status if status >= ERROR or status & _ALONE else status | self.scalar.status.bits

    def outputs(self) -> tuple[list[int], list[int]]:
        """The outputs and their standard deviations, where there are some."""
        names = [output.name for output in self.spec.outputs]
        if names:
            self.call(FUNCTION)
        told = [[self.memory.numbers[f"{argument}.{name}"] for name in names] for argument in (VALUE, DEVIATION)]
        return told[0], told[1]

    @property
    def x(self) -> list[int]:
        return list(self.memory.arrays["kf.x"])

    @property
    def variances(self) -> list[int]:
        """The diagonal of P."""
        self.call("get_covariance")
        P, n = self.memory.arrays["P"], len(self.memory.arrays["kf.x"])
        return [P[i * n + i] for i in range(n)]


def record_exactly(spec: Spec, code: FilterCode, scalar: Fixed, declared: Declarations, track: Track) -> Record:
    """The record of a program, its track in raw numbers. KfgenError where not one step can be recorded."""
    value = value_of(declared)
    units = Units(spec, value)
    u, dt = value.to_raw(track.u, units.u), value.to_raw(track.dt, units.dt)
    z = value.to_raw(track.z, np.concatenate([units.z[sensor.name] for sensor in spec.measurements]))
    twin = Twin(code, scalar)
    status = twin.call("init")
    covariance = declared.has("get_covariance")
    xs, variances, statuses, told = [], [], [], []
    for k in range(len(dt)):
        if status < ERROR:
            status = _step(spec, twin, u[k].tolist(), dt[k].item(), z[k].tolist(), k)
        if status >= ERROR:
            break
        xs.append(twin.x)
        variances.append(twin.variances if covariance else [])
        statuses.append(status)
        told.append(twin.outputs())
    if not xs:
        raise KfgenError(f"{spec.name}: the filter does not get through one step of a simulated run")
    x = np.array(xs, dtype=np.float64)
    variance = np.array(variances, dtype=np.float64) if covariance else None
    steps = Track(u.astype(np.float64), dt.astype(np.float64), z.astype(np.float64)).first(len(xs))
    outputs = np.array(told, dtype=np.float64).reshape(-1, 2, len(spec.outputs))
    return Record(
        steps, x, variance, 0.0, np.zeros(x.shape[1]), tuple(statuses), outputs[:, 0], outputs[:, 1],
    )  # fmt: skip


def _step(spec: Spec, twin: Twin, u: list[int], dt: int, z: list[int], k: int) -> int:
    """The calls of a step; all that they tell."""
    given = twin.memory.numbers
    given.update({"dt": dt, **{f"u.{each.name}": raw for each, raw in zip(spec.inputs, u, strict=True)}})
    status = twin.call("predict")
    for i, (sensor, place) in enumerate(readings_of(spec)):
        if k % (i + 1) == 0 and status < ERROR:
            names = [f"z.{each.name}" for each in sensor.fields]
            given.update(zip(names, z[place], strict=True))
            status |= twin.call(f"update_{sensor.name}")
    return status
