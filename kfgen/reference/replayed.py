"""What a filter has to offer for a log to be replayed through it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from numpy.typing import ArrayLike

from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.model import Model
from kfgen.reference.sensor import SensorModel
from kfgen.spec.types import Spec


class Replayed(Protocol):
    """See `kfgen.reference.filter.ReferenceFilter`."""

    spec: Spec
    model: Model

    @property
    def nis(self) -> float: ...

    @property
    def sensors(self) -> Mapping[str, SensorModel]: ...

    @property
    def x(self) -> Vector: ...

    @property
    def P(self) -> Matrix: ...

    @property
    def mu(self) -> Vector: ...

    @property
    def outputs(self) -> dict[str, float]: ...

    @property
    def output_std(self) -> dict[str, float]: ...

    def predict(self, u: ArrayLike | None = None, dt: float | None = None) -> int: ...

    def update(
        self, sensor: str, z: ArrayLike, u: ArrayLike | None = None, mask: int | Sequence[bool] | None = None,
        inputs: ArrayLike | Mapping[str, float] | None = None,
    ) -> int: ...  # fmt: skip
