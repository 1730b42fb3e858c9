"""What the first measurements of some sensors set: states and variances, as formulas of what is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy

from kfgen.model.symbolic import to_sympy
from kfgen.spec.tree import Name
from kfgen.spec.types import Spec

Symbolic = Any  # a SymPy expression


@dataclass(frozen=True)
class FirstModel:
    """What the first measurement of a sensor sets.

    states: by name; variances: by the name of the error's coordinate. components: those that these are made of; a
    symbol of such a name is what is measured. waits: until every named sensor has come nothing else is done.
    """

    sensor: str
    states: Mapping[str, Symbolic]
    variances: Mapping[str, Symbolic]
    components: tuple[str, ...]
    waits: bool
    plain: bool  # states that are components, and no more

    def uses(self) -> set[str]:
        """Names that the formulas use, but for components."""
        expressions = [*self.states.values(), *self.variances.values()]
        return {s.name for e in expressions for s in e.free_symbols} - set(self.components)


def build_firsts(spec: Spec, names: Mapping[str, Symbolic]) -> tuple[FirstModel, ...]:
    """names: of constants, parameters and inputs, those of sensors too."""
    sensors = {sensor.name: sensor for sensor in spec.measurements}
    out = []
    for rule in spec.initialize:
        components = {c.name: sympy.Symbol(c.name) for c in sensors[rule.sensor].components}
        known = {**names, **components}
        states = {name: to_sympy(e.tree, known) for name, e in rule.states.items()}
        variances = {name: to_sympy(e.tree, known) for name, e in rule.variance.items()}
        used = {s.name for e in (*states.values(), *variances.values()) for s in e.free_symbols}
        plain = all(isinstance(e.tree, Name) and e.tree.name in components for e in rule.states.values())
        out.append(
            FirstModel(
                rule.sensor, states, variances, tuple(name for name in components if name in used), rule.waits,
                plain and not variances and not rule.waits,
            )
        )  # fmt: skip
    return tuple(out)
