"""What a filter has to answer along a track to the bit: its program, interpreted in its own arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np

from kfgen.errors import KfgenError
from kfgen.filters.base import FilterCode
from kfgen.fixed.scalar import Fixed
from kfgen.ir import interpret
from kfgen.native.header import Header
from kfgen.native.values import Units, value_of
from kfgen.scalars import SCALARS, Scalar
from kfgen.selftest.record import Record
from kfgen.selftest.track import Track
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

_EMPTY = {"uint32": 0, "bool": False}
_ALONE = int(Status.GATED)
"""With it, as with an error, nothing else is told: what was computed before is not stored."""


class Twin:
    """A filter as its program is interpreted: what the compiled C holds and returns, bit for bit."""

    def __init__(self, code: FilterCode, scalar: Scalar) -> None:
        self.scalar = scalar
        self.memory = interpret.Memory()
        self._functions = {each.name: each for each in code.functions}
        n = len(code.model.states)
        self.memory.arrays["P"] = [scalar.convert(0)] * n * n
        for block in code.blocks:
            empty = _EMPTY[block.kind] if block.kind in _EMPTY else scalar.convert(0)
            if block.size is None:
                self.memory.numbers[f"kf.{block.name}"] = empty
            else:
                self.memory.arrays[f"kf.{block.name}"] = [empty] * block.size

    def call(self, function: str) -> int:
        """The status of a function, its arguments being in the memory."""
        if isinstance(self.scalar, Fixed):
            self.scalar.status.bits = 0
        with np.errstate(all="ignore"):
            flags = interpret.run(self._functions[function], self.scalar, self.memory)
        status = sum(int(Status[flag]) for flag in flags)
        if status >= ERROR or status & _ALONE or not isinstance(self.scalar, Fixed):
            return status
        return status | self.scalar.status.bits

    @property
    def x(self) -> list[Any]:
        return list(self.memory.arrays["kf.x"])

    @property
    def variances(self) -> list[Any]:
        """The diagonal of P."""
        self.call("get_covariance")
        P, n = self.memory.arrays["P"], len(self.memory.arrays["kf.x"])
        return [P[i * n + i] for i in range(n)]


def scalar_of(spec: Spec) -> Scalar:
    """The arithmetic of a spec's scalar type."""
    return SCALARS[spec.scalar] if spec.scalar in SCALARS else Fixed(spec.scalar, spec.fixed.rounding)


def record_exactly(spec: Spec, code: FilterCode, header: Header, track: Track) -> Record:
    """The record of a program, its track in raw numbers. KfgenError where not one step can be recorded."""
    value = value_of(header)
    units = Units(spec, value)
    u, dt = value.to_raw(track.u, units.u), value.to_raw(track.dt, units.dt)
    z = value.to_raw(track.z, np.concatenate([units.z[sensor.name] for sensor in spec.measurements]))
    twin = Twin(code, scalar_of(spec))
    status = twin.call("init")
    covariance = header.has("get_covariance")
    xs, variances, statuses = [], [], []
    for k in range(len(dt)):
        if status < ERROR:
            status = _step(spec, twin, u[k].tolist(), dt[k].item(), z[k].tolist(), k)
        if status >= ERROR:
            break
        xs.append(twin.x)
        variances.append(twin.variances if covariance else [])
        statuses.append(status)
    if not xs:
        raise KfgenError(f"{spec.name}: the filter does not get through one step of a simulated run")
    x = np.array(xs, dtype=np.float64)
    variance = np.array(variances, dtype=np.float64) if covariance else None
    steps = Track(u.astype(np.float64), dt.astype(np.float64), z.astype(np.float64)).first(len(xs))
    return Record(steps, x, variance, 0.0, np.zeros(x.shape[1]), tuple(statuses))


def _step(spec: Spec, twin: Twin, u: list[Any], dt: Any, z: list[Any], k: int) -> int:
    """The calls of a step; all that they tell."""
    given, convert = twin.memory.numbers, twin.scalar.convert
    given["dt"] = convert(dt)
    given.update({f"u.{each.name}": convert(raw) for each, raw in zip(spec.inputs, u, strict=True)})
    status, first = twin.call("predict"), 0
    for i, sensor in enumerate(spec.measurements):
        last = first + len(sensor.components)
        if k % (i + 1) == 0 and status < ERROR:
            names = [f"z.{each.name}" for each in sensor.components]
            given.update({name: convert(raw) for name, raw in zip(names, z[first:last], strict=True)})
            status |= twin.call(f"update_{sensor.name}")
        first = last
    return status
