"""A filter's struct in memory and its C functions: all that touches cffi once a library is loaded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen.emit.declarations import Declarations
from kfgen.native.arguments import numpy_type
from kfgen.native.values import Array, Units, Value, value_of
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status


class Struct:
    """One filter's struct.

    declared: what its header declares. ffi, lib: cffi's. data: the pointer to the struct. fields: the names of
    its fields. compensated: the states that have a second word, x_rest. value, units: how its numbers become
    physical ones.
    """

    def __init__(self, spec: Spec, declared: Declarations, ffi: Any, lib: Any) -> None:
        self.name = spec.name
        self.declared = declared
        self.ffi = ffi
        self.lib = lib
        self.value: Value = value_of(declared)
        self.units = Units(spec, self.value)
        self.data = ffi.new(f"{spec.name}_t *")
        self.compensated = tuple(i for i, s in enumerate(spec.states) if s.name in spec.code.compensated)
        self.fields = {name for name, _ in ffi.typeof(f"{spec.name}_t").fields}

    has_past = False
    """Whether the filter stands in a history."""

    @property
    def whole(self) -> Any:
        """The pointer to all that a run changes."""
        return self.data

    def copy(self) -> Struct:
        """Another struct of the same bytes."""
        other = object.__new__(Struct)
        other.__dict__.update(self.__dict__)
        other.data = self.ffi.new(f"{self.name}_t *")
        self.ffi.memmove(other.data, self.data, self.ffi.sizeof(self.data[0]))
        return other

    def __bytes__(self) -> bytes:
        return bytes(self.ffi.buffer(self.data))

    # functions

    def has(self, function: str) -> bool:
        return self.declared.has(function)

    def takes(self, function: str, argument: str) -> bool:
        """Whether there is a function, and it has an argument of that name."""
        return self.declared.takes(function, argument)

    def function(self, name: str) -> Any:
        """The C function `<prefix>_<name>`; AttributeError where the filter has none."""
        if not self.has(name):
            raise AttributeError(f"filter {self.name} has no function {self.name}_{name}")
        return getattr(self.lib, f"{self.name}_{name}")

    def call(self, function: str, *arguments: Any) -> int:
        """The status of a function; NOT_FINITE where an argument is None, which stands for a NaN."""
        if any(argument is None for argument in arguments):  # a fixed-point scalar has no NaN to pass on
            return int(Status.NOT_FINITE)
        return int(self.function(function)(self.data, *arguments) or 0)

    def get(self, function: str, unit: Array) -> Array:
        """What a function writes to an array of the shape of `unit`, in physical units."""
        out = self.ffi.new(f"{self.name}_real_t[]", unit.size)
        self.function(function)(self.data, out)
        raw = np.frombuffer(self.ffi.buffer(out), dtype=self.value.dtype).reshape(unit.shape)
        return self.value.to_physical(raw, unit)

    def outputs(self, names: Sequence[str]) -> tuple[Array, Array]:
        """The outputs and their standard deviations; NaN where the filter refuses to tell them."""
        told = [self.ffi.new(f"{self.name}_outputs_t *") for _ in range(2)]
        if self.call("get_outputs", *told) >= ERROR:
            return np.full(len(names), np.nan), np.full(len(names), np.nan)
        raw = [np.array([getattr(each, name) for name in names], self.value.dtype) for each in told]
        value, deviation = (self.value.to_physical(each, self.units.outputs) for each in raw)
        return value, deviation

    # arguments; None where the scalar type cannot carry the numbers

    def raw(self, values: Array, unit: Array | float) -> NDArray[Any] | None:
        """Physical numbers in the filter's own type."""
        return self.value.to_raw(values, unit) if self.value.representable(values) else None

    def array(self, values: Array, unit: Array) -> Any:
        """An array argument."""
        raw = self.raw(values, unit)
        return None if raw is None else self.ffi.new(f"{self.name}_real_t[]", raw.ravel().tolist())

    def record(self, name: str, values: Array, unit: Array) -> Any:
        """An argument of the type `<prefix>_<name>_t`."""
        raw = self.raw(values, unit)
        return None if raw is None else self.ffi.new(f"{self.name}_{name}_t *", raw.tolist())

    # fields

    def number(self, field: str) -> float:
        """A field that is a number without a unit."""
        return float(self.value.to_physical(self.field(field), self.units.one))

    def field(self, name: str) -> NDArray[Any]:
        """A field of reals in the filter's own type; AttributeError where there is none."""
        if name not in self.fields:
            raise AttributeError(f"filter {self.name} has no field {name}")
        return np.asarray(self.plain(getattr(self.data, name)), dtype=self.value.dtype)

    def plain(self, data: Any) -> Any:
        """A C value as numpy arrays and numbers; a struct as a dict."""
        if not isinstance(data, self.ffi.CData):
            return data
        kind = self.ffi.typeof(data)
        if kind.kind == "struct":
            return {name: self.plain(getattr(data, name)) for name, _ in kind.fields}
        return np.array(self.ffi.unpack(data, len(data)), dtype=numpy_type(kind.item, self.ffi))
