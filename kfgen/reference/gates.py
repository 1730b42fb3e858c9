"""The gates of a spec's sensors: chi-square tests of the normalised innovation squared of a whole vector."""

from __future__ import annotations

import math

from kfgen.reference.chi2 import chi2_quantile
from kfgen.reference.dual import value_of
from kfgen.reference.model import Model
from kfgen.reference.sensor import Reading
from kfgen.reference.status import Status, StepError


class Gates:
    """Bar-Shalom, Li & Kirubarajan 2001, section 5.4."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._gates = {sensor.name: sensor.gate for sensor in model.spec.measurements if sensor.gate is not None}
        self._formulas = {
            name: model.scope.compile(gate.threshold)
            for name, gate in self._gates.items()
            if gate.threshold is not None
        }
        self._quantiles: dict[tuple[str, int], float] = {}

    def judge(self, reading: Reading, nis: float, rejected: int) -> Status:
        """OK where a reading with this nis passes, GATED where it does not, and ANOMALY where it fails but so
        many of its sensor have been rejected in a row that it is taken all the same.

        Raises StepError NOT_FINITE for a threshold that is not finite.
        """
        name = reading.sensor.name
        if name not in self._gates or nis <= self._threshold(reading):
            return Status.OK
        reset_after = self._gates[name].reset_after
        return Status.GATED if reset_after is None or rejected < reset_after else Status.ANOMALY

    def _threshold(self, reading: Reading) -> float:
        """The formula of a sensor's gate, or its chi-square quantile with so many components."""
        name, used = reading.sensor.name, len(reading.used)
        if name in self._formulas:
            given = self.model.environment(reading.context, self.model.x0, own=reading.sensor.own)
            value = value_of(self._formulas[name](given))
            if not math.isfinite(value):
                raise StepError(Status.NOT_FINITE)
            return value
        key = name, used
        if key not in self._quantiles:
            probability = self._gates[name].probability
            assert probability is not None
            self._quantiles[key] = chi2_quantile(self.model.number(probability), used)
        return self._quantiles[key]
