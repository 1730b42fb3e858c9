"""`initialize`: which states the first update of a sensor sets, by expressions in its components."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kfgen.spec.raw import Fields, Word
from kfgen.spec.shaping.extents import Shaped
from kfgen.spec.shaping.formulas import FormulaReader
from kfgen.spec.shaping.targets import TargetReader
from kfgen.spec.types import Definition


class StartShaper:
    def __init__(self, reader: FormulaReader, targets: TargetReader) -> None:
        self.reader, self.targets = reader, targets

    def initialize(self, raw: Any, components: dict[str, dict[str, Shaped]]) -> Any:
        """A mapping, or a list of them; always a list from here on."""
        rules = raw if isinstance(raw, tuple) else (raw,)
        found = tuple(self._rule(rule, components) for rule in rules if isinstance(rule, Fields))
        for rule in found:
            rule.values["waits"] = isinstance(raw, tuple)
        return found

    def _rule(self, raw: Fields, components: dict[str, dict[str, Shaped]]) -> Fields:
        sensor = raw.get("from")
        local = components.get(sensor.text, {}) if isinstance(sensor, Word) else {}
        own: list[Definition] = []
        flat = replace(raw, values=dict(raw.values))
        for key, errors in (("states", False), ("var", True)):
            written = raw.get(key)
            if isinstance(written, Fields):
                flat.values[key], _ = self.targets.table(
                    written, errors, key, whole=not errors, local=local, own=own, spread=errors
                )
        flat.values["let"] = tuple(own)
        return flat
