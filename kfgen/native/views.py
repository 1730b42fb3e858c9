"""Views into a filter: its parameters, and the modes of a bank."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kfgen.native.arguments import unknown
from kfgen.native.values import Array

if TYPE_CHECKING:
    from kfgen.native.filter import NativeFilter


class ModeView:
    """One mode of a bank: its own estimate."""

    def __init__(self, kf: NativeFilter, name: str) -> None:
        self._filter = kf
        self.name = name

    @property
    def x(self) -> Array:
        """The mode's state [n]."""
        return self._filter._value.to_physical(self.raw["x"], self._filter._units.x)

    @property
    def raw(self) -> dict[str, Any]:
        """The fields of the mode's block."""
        fields: dict[str, Any] = self._filter._plain(getattr(self._filter._kf.modes, self.name))
        return fields


class Parameters(MutableMapping[str, float]):
    """The parameters of a filter in physical units; none can be added or removed."""

    def __init__(self, kf: NativeFilter) -> None:
        self._filter = kf

    def _known(self, name: str) -> str:
        if name not in self._filter._units.parameters:
            raise KeyError(unknown("parameter", name, self._filter._units.parameters))
        return name

    def __getitem__(self, name: str) -> float:
        kf = self._filter
        raw = getattr(kf._kf.parameters, self._known(name))
        return float(kf._value.to_physical(np.array(raw, kf._value.dtype), kf._units.parameters[name]))

    def __setitem__(self, name: str, value: float) -> None:
        kf = self._filter
        raw = kf._raw(np.array(float(value)), kf._units.parameters[self._known(name)])
        if raw is None:
            raise ValueError(f"parameter {name!r} cannot be {value} in fixed point")
        setattr(kf._kf.parameters, name, raw.item())

    def __delitem__(self, name: str) -> None:
        raise TypeError("a parameter cannot be removed")

    def __iter__(self) -> Iterator[str]:
        return iter(self._filter._units.parameters)

    def __len__(self) -> int:
        return len(self._filter._units.parameters)

    def __repr__(self) -> str:
        return repr(dict(self))
