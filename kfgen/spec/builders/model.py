"""The raw data of the model -> states, noises, dynamics and sensors; of the top and of a mode alike."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from typing import Any

from kfgen.spec.builders.filter import FilterBuilder
from kfgen.spec.builders.values import Values
from kfgen.spec.raw import Fields, Word, entries, limits, matrix
from kfgen.spec.shaping.vectors import RawRotation
from kfgen.spec.tree import Expression, Number, names
from kfgen.spec.types import (
    Component,
    Covariance,
    Definition,
    Dynamics,
    Gate,
    Input,
    Matrix,
    Noise,
    Rotation,
    Sensor,
    State,
)


class ModelBuilder:
    """Builds the parts of a model; each method takes the raw data under its key, whatever it may be."""

    def __init__(self, values: Values) -> None:
        self.values = values
        self.problems = values.problems

    def states(self, written: Any, covered: bool) -> tuple[State, ...]:
        found = []
        for name, f in entries(written):
            kind, period = self.values.kind(f)
            if kind == "quaternion":
                self.excluded(name, f, ("bounds",))
            found.append(
                State(
                    name,
                    self.values.formula(f, "init"),
                    None if kind == "quaternion" else self.values.variance(f, covered),
                    f.get("unit", ""),
                    limits(f, "range"),
                    kind,
                    period,
                    limits(f, "bounds"),
                    f.get("doc", ""),
                    f.place,
                )
            )
        return tuple(found)

    def excluded(self, name: str, f: Fields, keys: tuple[str, ...]) -> None:
        """Keys that mean nothing for a quaternion."""
        for key in keys:
            if key in f:
                text = f"`{key}` does not go with a quaternion: its four numbers have no limits of their own"
                self.problems.add(f.at(key), text, "bound a number that you derive from it, or leave it out")

    def rotations(self, raw: Iterable[RawRotation], covered: bool) -> tuple[Rotation, ...]:
        """The quaternions among states or components, with the variances of their errors."""
        found = []
        for rotation in raw:
            f = rotation.fields
            variances = [self.values.variance(each, covered) for each in rotation.entries]
            w, x, y, z = rotation.parts
            found.append(
                Rotation(
                    rotation.name,
                    (w, x, y, z),
                    rotation.errors,
                    f.get("error", "body"),
                    f.get("reset", True),
                    (variances[0], variances[1], variances[2]),
                    f.place,
                )
            )
        return tuple(found)

    def definitions(self, written: Any, hidden: tuple[Definition, ...] = ()) -> tuple[Definition, ...]:
        """In an order in which each uses only those before it; a cycle is reported once."""
        found = {name: Definition(name, expression) for name, expression in entries(written)}
        found |= {definition.name: definition for definition in hidden}
        order: list[Definition] = []
        state: dict[str, int] = {}  # 1: on the way, 2: done

        def visit(name: str, trail: list[str]) -> None:
            stack: list[tuple[str, list[str]]] = [(name, used(found[name]))]
            state[name] = 1
            while stack:
                current, rest = stack[-1]
                if not rest:
                    stack.pop()
                    state[current] = 2
                    order.append(found[current])
                    continue
                other = rest.pop()
                if state.get(other) == 1:
                    trail = [n for n, _ in stack]
                    cycle = [*trail[trail.index(other) :], other]
                    self.problems.add(
                        found[cycle[0]].value.place,
                        "the definitions use each other in a circle: " + " -> ".join(cycle),
                        "break the circle",
                    )
                elif other not in state:
                    state[other] = 1
                    stack.append((other, used(found[other])))

        def used(definition: Definition) -> list[str]:
            return [n for n in reversed(list(dict.fromkeys(names(definition.value.tree)))) if n in found]

        for name in found:
            if name not in state:
                visit(name, [])
        return tuple(order)

    def covariances(self, top: Fields) -> tuple[Covariance, ...]:
        found = []
        for triple in top.get("covariances", ()):
            if triple is None:
                continue
            first, second, amount = triple
            if isinstance(first, Word) and isinstance(second, Word):
                found.append(Covariance(first.text, second.text, amount))
        return tuple(found)

    def noises(self, written: Any, covered: bool, densities: bool = True) -> tuple[Noise, ...]:
        more = ("density", "root_density") if densities else ()
        found = []
        for name, f in entries(written):
            variance = self.values.variance(f, covered, more=more)
            density = "std" not in f and "var" not in f and ("density" in f or "root_density" in f)
            found.append(Noise(name, variance, density, f.get("unit", ""), f.get("doc", ""), f.place))
        return tuple(found)

    def blocks(
        self, f: Fields, key: str, names: tuple[str, ...], variances: Iterable[Expression | None], kind: str = "blocks"
    ) -> Matrix | None:
        """A full covariance: as it is written, or of variances among which vectors have a matrix."""
        blocks = f.get(kind, {})
        if key in f or not blocks:
            return matrix(f.get(key))
        zero = Expression(Number(Fraction(0)), "0", f.place)
        index = {name: i for i, name in enumerate(names)}
        rows = [[zero] * len(names) for _ in names]
        for i, variance in enumerate(variances):
            rows[i][i] = variance or zero
        for first, block in blocks.items():
            for i, row in enumerate(block):
                for j, entry in enumerate(row):
                    rows[index[first] + i][index[first] + j] = entry
        return tuple(map(tuple, rows))

    def noise_covariance(self, f: Fields, noise: tuple[Noise, ...]) -> Matrix | None:
        names, variances = tuple(n.name for n in noise), (n.variance for n in noise)
        return self.blocks(f, "noise_covariance", names, variances, "noise blocks")

    def dynamics(self, f: Any) -> Dynamics:
        if not isinstance(f, Fields):
            return Dynamics()
        noise = f.get("Q", {})
        return Dynamics(
            form=f.get("form", "discrete"),
            f=dict(entries(f.get("f"))),
            integrator=f.get("integrator", "rk4"),
            substeps=max(1, self.values.number(f.get("substeps")) or 1),
            Q=dict(entries(noise)) if isinstance(noise, Fields) else matrix(noise) or {},
            place=f.place,
        )

    def sensors(self, written: Any) -> tuple[Sensor, ...]:
        return tuple(self.sensor(name, f) for name, f in entries(written))

    def sensor(self, name: str, f: Fields) -> Sensor:
        noise = self.noises(f.get("noise"), "noise_covariance" in f, densities=False)
        self.values.both(f, "R", f.get("z"), f.get("rotations", ()))
        self.values.both(f, "noise_covariance", f.get("noise"))
        components = tuple(self.component(n, c, "R" in f, "noise" in f) for n, c in entries(f.get("z")))
        rotations = self.rotations(f.get("rotations", ()), "R" in f)
        gate = f.get("gate")
        sensor = Sensor(
            name,
            components,
            None,
            noise,
            self.noise_covariance(f, noise),
            self.gate(gate) if isinstance(gate, Fields) else None,
            f.get("partial", False),
            f.get("rate"),
            self.own(f),
            self.inputs(f.get("inputs")),
            f.get("groups", ()),
            rotations,
            f.get("doc", ""),
            f.place,
        )
        return replace(sensor, R=self.blocks(f, "R", sensor.errors, self.variances(sensor)))

    @staticmethod
    def variances(sensor: Sensor) -> list[Expression | None]:
        """Of each coordinate of the innovation."""
        known = {component.name: component.variance for component in sensor.components}
        known |= {e: v for r in sensor.rotations for e, v in zip(r.errors, r.variances, strict=True)}
        return [known[name] for name in sensor.errors]

    def inputs(self, written: Any) -> tuple[Input, ...]:
        return tuple(
            Input(name, f.get("unit", ""), limits(f, "range"), f.get("doc", ""), f.place)
            for name, f in entries(written)
        )

    def own(self, f: Fields) -> dict[str, Any]:
        """The options of the filter that a sensor has of its own."""
        options = FilterBuilder(self.values)
        found: dict[str, Any] = {}
        if "robust" in f:
            found["robust"] = options.robust(f)
        if "adaptive" in f:
            found["adaptive"] = options.adaptive(f)
        if "adapt_R" in f:
            rate = f.get("adapt_R")
            found["adapt_R"] = None if rate is None or rate.text == "none" else rate
        return found

    def gate(self, f: Fields) -> Gate:
        given = [key for key in ("probability", "threshold") if key in f]
        if len(given) == 2:
            text = "`probability` and `threshold` are given both"
            self.problems.add(f.places["threshold"], text, "remove one of them")
        elif not given and not f.bad:
            self.problems.add(f.place, "`probability` or `threshold` is missing", "write `probability: 0.999`")
        return Gate(f.get("probability"), f.get("threshold"), self.values.number(f.get("reset_after")))

    def component(self, name: str, f: Fields, covered: bool, noisy: bool) -> Component:
        kind, period = self.values.kind(f)
        rotation = kind == "quaternion"  # its variances are those of its error
        variance = None if rotation else self.values.variance(f, covered, needed=not noisy)
        if "residual" in f and kind != "real":
            self.problems.add(f.places["residual"], "`kind` wraps the residual already", "remove one of them")
        return Component(
            name,
            self.values.formula(f, "h"),
            variance,
            f.get("unit", ""),
            limits(f, "range"),
            kind,
            period,
            f.get("residual"),
            f.get("doc", ""),
            f.place,
        )
