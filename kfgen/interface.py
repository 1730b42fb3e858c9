"""What every filter offers in Python, the compiled one and the reference alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Filter(Protocol):
    """One filter, in physical units and float64; n states, m components of a sensor, nu inputs.

    The methods return the status bits, see `kfgen.Status`.
    """

    @property
    def x(self) -> Array:
        """The state [n]."""
        ...

    @property
    def P(self) -> Array:
        """The covariance [n, n]."""
        ...

    @property
    def mu(self) -> Array:
        """The probabilities of the modes of an imm; AttributeError for other filters."""
        ...

    @mu.setter
    def mu(self, mu: Array) -> None: ...

    def init(self) -> int: ...

    def predict(self, u: Array | None = None, dt: float | None = None) -> int:
        """u [nu] and dt in s: only, and always, where the filter takes them."""
        ...

    def update(
        self, sensor: str, z: Array, u: Array | None = None, mask: int | Sequence[bool] | None = None,
        inputs: Array | None = None,
    ) -> int:  # fmt: skip
        """z [m]; u [nu] where the sensor takes inputs; mask: the components to use, bit i for component i; inputs:
        the sensor's own, where it has some."""
        ...

    def set_state(self, x: Array) -> int: ...

    def set_covariance(self, P: Array) -> int: ...
