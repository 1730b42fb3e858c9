"""The gates of a spec's sensors: chi-square tests of the normalised innovation squared of a whole vector."""

from __future__ import annotations

from kfgen.reference.chi2 import chi2_quantile
from kfgen.reference.model import Model
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status
from kfgen.spec.types import Gate


class Gates:
    """Bar-Shalom, Li & Kirubarajan 2001, section 5.4."""

    def __init__(self, model: Model) -> None:
        self._gates: dict[str, tuple[Gate, float]] = {
            sensor.name: (sensor.gate, model.number(sensor.gate.probability))
            for sensor in model.spec.measurements
            if sensor.gate is not None
        }
        self._thresholds: dict[tuple[str, int], float] = {}

    def judge(self, reading: Reading, nis: float, rejected: int) -> Status:
        """OK where a reading with this nis passes, GATED where it does not, and ANOMALY where it fails but so
        many of its sensor have been rejected in a row that it is taken all the same."""
        name = reading.sensor.name
        if name not in self._gates or nis <= self._threshold(name, len(reading.used)):
            return Status.OK
        reset_after = self._gates[name][0].reset_after
        return Status.GATED if reset_after is None or rejected < reset_after else Status.ANOMALY

    def _threshold(self, sensor: str, used: int) -> float:
        """The chi-square quantile of a sensor's gate with so many components."""
        key = (sensor, used)
        if key not in self._thresholds:
            self._thresholds[key] = chi2_quantile(self._gates[sensor][1], used)
        return self._thresholds[key]
