"""Views into a filter: its parameters, and the modes of a bank."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping, Sequence
from typing import Any

import numpy as np

from kfgen.native.arguments import unknown
from kfgen.native.struct import Struct
from kfgen.native.values import Array


class ModeView:
    """One mode of a bank: its own estimate."""

    def __init__(self, struct: Struct, names: Sequence[str], place: int) -> None:
        self._struct = struct
        self.name = names[place]
        self._certain = np.array([float(i == place) for i in range(len(names))])

    @property
    def x(self) -> Array:
        """The mode's state [n]."""
        return self._struct.value.to_physical(self.raw["x"], self._struct.units.x)

    @property
    def P(self) -> Array:
        """The mode's covariance [n, n]: that of the bank if it were certain of the mode."""
        other = self._struct.copy()
        mu = other.raw(self._certain, other.units.one)
        assert mu is not None
        other.data.mu = mu.tolist()
        return other.get("get_covariance", other.units.P)

    @property
    def nis(self) -> float:
        """The normalised innovation squared of the mode in the last update that was made."""
        raw = np.array(self.raw["nis"], self._struct.value.dtype)
        return float(self._struct.value.to_physical(raw, self._struct.units.one))

    @property
    def raw(self) -> dict[str, Any]:
        """The fields of the mode's block."""
        fields: dict[str, Any] = self._struct.plain(getattr(self._struct.data.modes, self.name))
        return fields


class Parameters(MutableMapping[str, float]):
    """The parameters of a filter in physical units; none can be added or removed."""

    def __init__(self, struct: Struct) -> None:
        self._struct = struct

    def _known(self, name: str) -> str:
        if name not in self._struct.units.parameters:
            raise KeyError(unknown("parameter", name, self._struct.units.parameters))
        return name

    def __getitem__(self, name: str) -> float:
        struct = self._struct
        raw = getattr(struct.data.parameters, self._known(name))
        return float(struct.value.to_physical(np.array(raw, struct.value.dtype), struct.units.parameters[name]))

    def __setitem__(self, name: str, value: float) -> None:
        struct = self._struct
        raw = struct.raw(np.array(float(value)), struct.units.parameters[self._known(name)])
        if raw is None:
            raise ValueError(f"parameter {name!r} cannot be {value} in fixed point")
        setattr(struct.data.parameters, name, raw.item())

    def __delitem__(self, name: str) -> None:
        raise TypeError("a parameter cannot be removed")

    def __iter__(self) -> Iterator[str]:
        return iter(self._struct.units.parameters)

    def __len__(self) -> int:
        return len(self._struct.units.parameters)

    def __repr__(self) -> str:
        return repr(dict(self))
