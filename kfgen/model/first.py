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

    states: by name; variances: by the name of the error's coordinate. definitions: what these share, each in those
    before it. components: those that all are made of; a symbol of such a name is what is measured. waits: until every
    named sensor has come nothing else is done. plain: states that are components, and no more.
    """

    sensor: str
    states: Mapping[str, Symbolic]
    variances: Mapping[str, Symbolic]
    definitions: tuple[tuple[str, Symbolic], ...]
    components: tuple[str, ...]
    waits: bool
    plain: bool

    def uses(self) -> set[str]:
        """Names that the formulas use, but for components."""
        expressions = [*self.states.values(), *self.variances.values(), *(e for _, e in self.definitions)]
        found = {s.name for e in expressions for s in e.free_symbols}
        return found - set(self.components) - {name for name, _ in self.definitions}


def build_firsts(spec: Spec, names: Mapping[str, Symbolic]) -> tuple[FirstModel, ...]:
    """names: of constants, parameters and inputs, those of sensors too."""
    sensors = {sensor.name: sensor for sensor in spec.measurements}
    out = []
    for rule in spec.initialize:
        components = {c.name: sympy.Symbol(c.name) for c in sensors[rule.sensor].components}
        known = {**names, **components}
        definitions = []
        for definition in rule.let:
            definitions.append((definition.name, to_sympy(definition.value.tree, known)))
            known[definition.name] = sympy.Symbol(definition.name)
        states = {name: to_sympy(e.tree, known) for name, e in rule.states.items()}
        variances = {name: to_sympy(e.tree, known) for name, e in rule.variance.items()}
        formulas = [*states.values(), *variances.values(), *(e for _, e in definitions)]
        used = {s.name for e in formulas for s in e.free_symbols}
        plain = all(isinstance(e.tree, Name) and e.tree.name in components for e in rule.states.values())
        own = tuple(name for name in components if name in used)
        alone = plain and not variances and not rule.waits
        out.append(FirstModel(rule.sensor, states, variances, tuple(definitions), own, rule.waits, alone))
    return tuple(out)
