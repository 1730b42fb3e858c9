"""Calls of a compiled filter's functions, past the Python interface: with NULL, NaN, and what it would refuse."""

from __future__ import annotations

from typing import Any

import numpy as np

from kfgen.native import NativeFilter
from kfgen.reference.reading import read_by_predict, read_by_update


class Calls:
    """The functions of one compiled filter, called with good arguments or with some that are wrong."""

    def __init__(self, kf: NativeFilter) -> None:
        self.kf = kf
        spec = kf.spec
        self.run_time = spec.dt is not None and spec.dt.run_time
        self.u = np.full(len(spec.inputs), 0.1)
        n = len(kf.states)
        self.updates: dict[str, str] = {}  # function -> sensor
        for sensor in spec.measurements:
            for function in (f"update_{sensor.name}", f"update_{sensor.name}_masked"):
                if kf.struct.has(function):
                    self.updates[function] = sensor.name
        self.names = ["predict", *self.updates, "set_state"]
        if kf.struct.has("set_covariance"):
            self.names.append("set_covariance")
        self.read = {function: read_by_update(spec, sensor) for function, sensor in self.updates.items()}
        self.read["predict"] = read_by_predict(spec)
        self.vectors: dict[str, dict[str, np.ndarray]] = {
            "set_state": {"x": np.full(n, 0.1)},
            "set_covariance": {"P": np.eye(n).ravel()},
        }
        for name in ("predict", *self.updates):
            self.vectors[name] = {}
            if name != "predict":
                m = len(kf.components(self.updates[name]))
                self.vectors[name]["z"] = np.full(m, 0.1)
            if kf.struct.takes(name, "u"):
                self.vectors[name]["u"] = self.u
            if kf.struct.takes(name, "dt"):
                self.vectors[name]["dt"] = np.array([0.1])
            if kf.struct.takes(name, "mask"):
                self.vectors[name]["mask"] = np.array([(1 << m) - 1])

    def leaves(self, name: str, key: str, i: int) -> bool:
        """Whether a function does not read a number of an argument: an input, or below the diagonal of P."""
        if key == "u":
            return self.kf.inputs[i] not in self.read[name]
        n = len(self.kf.states)
        return key == "P" and i // n > i % n

    def __call__(self, name: str, **changed: np.ndarray | None) -> int:
        """One call; an argument of None is a NULL pointer."""
        kf, ffi = self.kf, self.kf.struct.ffi
        pointer = kf.struct.data if changed.pop("kf", 0) is not None else ffi.NULL
        arguments: list[Any] = []
        for key, good in self.vectors[name].items():
            value = changed.get(key, good)
            if value is None:
                arguments.append(ffi.NULL)
            elif key == "dt":
                arguments.append(float(value[0]))
            elif key == "mask":
                arguments.append(int(value[0]))
            else:
                struct = {"u": f"{kf.name}_inputs_t *", "z": f"{kf.name}_{self.updates.get(name)}_t *"}
                arguments.append(ffi.new(struct.get(key, f"{kf.name}_real_t[]"), [float(v) for v in value]))
        return int(getattr(kf.struct.lib, f"{kf.name}_{name}")(pointer, *arguments))


def refused(calls: Calls, status: int, name: str, **changed: np.ndarray | None) -> None:
    """The call returns exactly this error and leaves every byte."""
    before = bytes(calls.kf)
    got = calls(name, **changed)
    assert got == status, f"{name} {changed}: {got:#x} for {status:#x}"
    assert bytes(calls.kf) == before, f"{name} {changed}: the filter has changed"
