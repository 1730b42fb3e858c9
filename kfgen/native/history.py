"""A compiled filter with its past, as a Python object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kfgen.emit.declarations import Declarations
from kfgen.native.arguments import Row
from kfgen.native.filter import NativeFilter
from kfgen.native.struct import Struct
from kfgen.spec.types import Spec

_TAKEN = ("init", "predict", "set_state", "set_covariance", "set_sqrt_covariance")


class PastStruct(Struct):
    """The struct of a filter inside that of its history: what changes it goes through the latter's functions."""

    def __init__(self, spec: Spec, declared: Declarations, ffi: Any, lib: Any) -> None:
        super().__init__(spec, declared, ffi, lib)
        self.past = ffi.new(f"{spec.name}_history_t *")
        self.data = ffi.addressof(self.past, "kf")
        self.age = 0  # of the next measurement

    has_past = True

    @property
    def whole(self) -> Any:
        return self.past

    def copy(self) -> PastStruct:
        other = object.__new__(PastStruct)
        other.__dict__.update(self.__dict__)
        other.past = self.ffi.new(f"{self.name}_history_t *")
        self.ffi.memmove(other.past, self.past, self.ffi.sizeof(self.past[0]))
        other.data = self.ffi.addressof(other.past, "kf")
        return other

    def __bytes__(self) -> bytes:
        """Those of the present estimate."""
        return bytes(self.ffi.buffer(self.data, self.ffi.sizeof(self.data[0])))

    def function(self, name: str) -> Any:
        function = super().function(name)
        if name in _TAKEN:
            own = getattr(self.lib, f"{self.name}_history_{name}")
            return lambda _, *arguments: own(self.past, *arguments)
        if name.startswith("update_"):
            own = getattr(self.lib, f"{self.name}_history_{name}")
            return lambda _, *arguments: own(self.past, *arguments, self.age)
        return function


class NativeHistory(NativeFilter):
    """A filter that takes late measurements at their time (`history` in the spec); else as a filter is.

    x, P and the rest are those of the present estimate. parameters may be set; what else is set begins a new past.
    """

    struct: PastStruct

    def update(
        self,
        sensor: str,
        z: Row,
        u: Row | None = None,
        mask: int | Sequence[bool] | None = None,
        inputs: Row | None = None,
        age: int = 0,
    ) -> int:
        """Take a measurement in at its time, `age` successful predictions ago.

        The status is that of the update at its time, TOO_OLD, or an error of what came since, repeated.
        """
        if not 0 <= age < 1 << 32 or age != int(age):
            raise ValueError(f"age counts predictions, 0 for the last one: not {age}")
        self.struct.age = int(age)
        return super().update(sensor, z, u, mask, inputs)

    def redraw(self) -> int:
        raise AttributeError(f"filter {self.name} with a history is changed by its own functions alone")

    @property
    def available(self) -> int:
        """How many predictions the past goes back."""
        return int(self.struct.past.available)
