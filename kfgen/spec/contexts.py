"""The names that formulas may use: a table of a spec, or of one of its modes, with what definitions rest on."""

from __future__ import annotations

from dataclasses import dataclass, field

from kfgen.spec.tree import Expression, names
from kfgen.spec.types import Definition, Sensor, Spec


@dataclass
class Context:
    """The names of a spec, or of one of its modes."""

    spec: Spec
    let: tuple[Definition, ...]
    sensors: tuple[Sensor, ...]
    kinds: dict[str, str] = field(default_factory=dict)  # name -> its kind
    closures: dict[str, frozenset[str]] = field(default_factory=dict)  # definition -> all that it rests on

    def __post_init__(self) -> None:
        groups = {group.name: group.parts for group in self.spec.groups}
        for definition in self.let:  # in an order in which each uses only those before it
            found: set[str] = set()
            for name in names(definition.value.tree):
                found |= self.closures.get(name, frozenset({name}))
            self.closures[definition.name] = frozenset(found)
        for name, parts in groups.items():  # a vector rests on what its parts rest on
            if any(part in self.closures for part in parts):
                self.closures[name] = frozenset().union(*(self.closures.get(part, frozenset()) for part in parts))

    def uses(self, expression: Expression | None) -> frozenset[str]:
        """The names a formula rests on, definitions resolved."""
        if expression is None:
            return frozenset()
        found: set[str] = set()
        for name in names(expression.tree):
            found |= self.closures.get(name, frozenset({name}))
        return frozenset(found)

    def uses_kinds(self, expression: Expression | None) -> frozenset[str]:
        """The kinds of the names a formula rests on; a fixed dt is a constant."""
        fixed = self.spec.dt is not None and not self.spec.dt.run_time
        special = {"dt": "constant" if fixed else "dt", "t": "t", "pi": "constant", "e": "constant"}
        return frozenset(special.get(n) or self.kinds.get(n, "unknown") for n in self.uses(expression))

    def sensor_names(self, sensor: str) -> dict[str, str]:
        """The inputs and noises of a sensor, parts and vectors: name -> kind."""
        found: dict[str, str] = {}
        for s in self.sensors:
            if s.name == sensor:
                found |= {i.name: "sensor input" for i in s.inputs}
                found |= {n.name: "sensor noise" for n in s.noise}
                found |= {g.name: found[g.parts[0]] for g in s.groups if g.parts[0] in found}
        return found

    def kind_of(self, name: str) -> str | None:
        """The kind of a name in any formula of this context; None where it is unknown."""
        if name in ("pi", "e", "dt", "t"):
            return name
        inputs = (i.name for s in self.sensors for i in s.inputs)
        return self.kinds.get(name) or ("input" if name in inputs else None)

    def component_names(self, sensor: str) -> frozenset[str]:
        """The components of a sensor, parts and vectors."""
        found: set[str] = set()
        for s in self.sensors:
            if s.name == sensor:
                found |= {c.name for c in s.components} | {r.name for r in s.rotations}
                found |= {g.name for g in s.groups if g.parts[0] in found}
        return frozenset(found)
