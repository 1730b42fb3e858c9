"""How numbers cross the border: physical float64 in Python, the filter's own scalar type in C."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen.emit.declarations import Declarations
from kfgen.errors import KfgenError
from kfgen.spec.constants import value as constant
from kfgen.spec.tree import Expression
from kfgen.spec.types import Spec

Array = NDArray[np.float64]


class Value(ABC):
    """One scalar type of the emitted code. `unit` arguments are physical values of raw 1 (an `_LSB`)."""

    dtype: np.dtype[Any]

    @abstractmethod
    def unit(self, name: str) -> float:
        """The physical value of raw 1 of a quantity, by its macro's name without prefix (`PX`, `GNSS_X`)."""

    @property
    @abstractmethod
    def one(self) -> float:
        """The physical value of raw 1 of a number without a unit (nis, mu, a likelihood)."""

    @abstractmethod
    def representable(self, values: Array) -> bool:
        """False where a call with these values can only be answered by NOT_FINITE."""

    @abstractmethod
    def to_raw(self, values: Array, unit: Array | float) -> NDArray[Any]: ...

    def near(self, values: Array, periods: Array) -> Array:
        """Values of quantities that repeat after `periods` (infinite: they do not), where the type can carry them."""
        return values

    @abstractmethod
    def to_physical(self, raw: NDArray[Any], unit: Array | float) -> Array: ...


class Floating(Value):
    """float and double: the physical value; NaN and infinity are passed on for the filter to refuse."""

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self.dtype = dtype

    def unit(self, name: str) -> float:
        return 1.0

    @property
    def one(self) -> float:
        return 1.0

    def representable(self, values: Array) -> bool:
        return True

    def to_raw(self, values: Array, unit: Array | float) -> NDArray[Any]:
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):  # too large for a float becomes infinite
            return np.asarray(values, dtype=np.float64).astype(self.dtype)

    def to_physical(self, raw: NDArray[Any], unit: Array | float) -> Array:
        return np.asarray(raw).astype(np.float64)


class Fixed(Value):
    """q<m>.<n>: an int32 of the quantity's least significant bit; rounded and saturated on the way in."""

    def __init__(self, units: Mapping[str, float], fraction_bits: int) -> None:
        self.dtype = np.dtype(np.int32)
        self._units = units
        self._fraction_bits = fraction_bits

    def unit(self, name: str) -> float:
        try:
            return self._units[name.upper()]
        except KeyError:
            raise KfgenError(f"the filter's header has no {name.upper()}_LSB") from None

    @property
    def one(self) -> float:
        return 2.0**-self._fraction_bits

    def representable(self, values: Array) -> bool:
        return bool(np.isfinite(values).all())

    def to_raw(self, values: Array, unit: Array | float) -> NDArray[Any]:
        scaled = np.nan_to_num(np.rint(np.asarray(values, dtype=np.float64) / unit))
        clipped: Array = np.clip(scaled, -(2.0**31), 2.0**31 - 1)
        return clipped.astype(np.int32)

    def near(self, values: Array, periods: Array) -> Array:
        """Within half a period of 0, to which a format of limited size would cut them off otherwise."""
        values = np.asarray(values, dtype=np.float64)
        repeating = np.isfinite(values) & np.isfinite(periods)
        period = np.where(repeating, periods, 1.0)
        turns = np.where(repeating, np.rint(np.where(repeating, values, 0.0) / period), 0.0)
        return np.asarray(values - period * turns)

    def to_physical(self, raw: NDArray[Any], unit: Array | float) -> Array:
        return np.asarray(raw).astype(np.float64) * unit


def value_of(declared: Declarations) -> Value:
    """The scalar type a filter was written for."""
    if declared.fraction_bits is not None:
        return Fixed(declared.units, declared.fraction_bits)
    return Floating(np.dtype({"float": np.float32, "double": np.float64}[declared.real]))


class Units:
    """The physical values of raw 1 of everything that crosses the border, as arrays in the spec's order."""

    def __init__(self, spec: Spec, value: Value) -> None:
        self.x: Array = np.array([value.unit(state.name) for state in spec.states])
        self.P: Array = np.outer(self.x, self.x) / value.one  # its LSB is LSB_i LSB_j 2^n
        self.u: Array = np.array([value.unit(each.name) for each in spec.inputs])
        self.z: dict[str, Array] = {
            sensor.name: np.array([value.unit(f"{sensor.name}_{each.name}") for each in sensor.fields])
            for sensor in spec.measurements
        }
        self.x_periods = np.array([_period(state.period, spec) for state in spec.states])
        self.z_periods: dict[str, Array] = {
            sensor.name: np.array([_period(getattr(each, "period", None), spec) for each in sensor.fields])
            for sensor in spec.measurements
        }
        self.reading_periods: Array = np.concatenate([np.empty(0), *self.z_periods.values()])
        self.readings: Array = np.concatenate([np.empty(0), *self.z.values()])  # all sensors' z, one after the other
        sizes = {sensor.name: len(sensor.components) for sensor in spec.measurements}
        self.R: dict[str, Array] = {s: np.outer(z[: sizes[s]], z[: sizes[s]]) / value.one for s, z in self.z.items()}
        self.outputs: Array = np.array([value.unit(each.name) for each in spec.outputs])
        self.parameters = {each.name: value.unit(each.name) for each in spec.parameters}
        run_time = spec.dt is not None and spec.dt.run_time
        self.dt = value.unit("dt") if run_time else 1.0
        self.one = value.one


def _period(period: Expression | None, spec: Spec) -> float:
    """After which a quantity repeats; infinite where it does not."""
    return math.inf if period is None else float(constant(period.tree, spec))
