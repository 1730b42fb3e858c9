"""The model: states, inputs, parameters, sensors, noises, and the equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from kfgen.report.blocks import Block, Equations, Grid, Section, figure
from kfgen.report.equations import equation, name, plain, word
from kfgen.report.subject import Subject
from kfgen.spec.constants import value
from kfgen.spec.modes import mode_specs
from kfgen.spec.tree import Expression
from kfgen.spec.types import Noise, Range, Sensor, Spec, State

ORDER = 10


def section(subject: Subject) -> Section:
    spec = subject.spec
    blocks: list[Block] = [_states(spec)]
    for caption, entries in (("Inputs", spec.inputs), ("Parameters", spec.parameters)):
        if entries:
            rows = [
                (e.name, e.unit, _number(spec, getattr(e, "value", None)), _range(spec, e.range), e.doc)
                for e in entries
            ]
            blocks.append(Grid(caption, ("name", "unit", "value", "range", "meaning"), rows, right=(2,)))
    if spec.constants:
        fixed = [(c.name, plain(c.value.text), _number(spec, c.value)) for c in spec.constants]
        blocks.append(Grid("Constants", ("name", "as written", "value"), fixed, right=(2,)))
    for mode, title in _modes(spec):
        blocks += _motion(mode, title)
    for mode, title in _modes(spec):
        if (
            title
            and all(mode.measurements == other.measurements for other, _ in _modes(spec))
            and title != _modes(spec)[0][1]
        ):
            continue
        blocks += _sensing(mode, title)
    if spec.initialize:
        blocks.append(Grid("First measurements", ("of", "sets", "to"), list(dict.fromkeys(_firsts(spec)))))
    if spec.outputs:
        blocks.append(Equations("Outputs", [equation(name(each.name), each.value) for each in spec.outputs]))
    return Section("Model", blocks, {"model": _data(spec)})


def _modes(spec: Spec) -> list[tuple[Spec, str]]:
    if spec.imm is None:
        return [(spec, "")]
    return [(mode, each.name) for mode, each in zip(mode_specs(spec), spec.imm.modes, strict=True)]


def _data(spec: Spec) -> dict[str, Any]:
    return {
        "states": [
            {"name": s.name, "unit": s.unit, "kind": s.kind, "init": _value(spec, s.init), "std": _std(spec, s)}
            for s in spec.states
        ],
        "inputs": [e.name for e in spec.inputs],
        "sensors": {s.name: [c.name for c in s.components] for s in spec.measurements},
        "parameters": {p.name: _value(spec, p.value) for p in spec.parameters},
    }


def _states(spec: Spec) -> Grid:
    rows = []
    for state in spec.states:
        deviation = _std(spec, state)
        std = "" if deviation is None else figure(deviation)
        rows.append((state.name, state.unit, "" if state.kind == "real" else state.kind, _number(spec, state.init), std,
                     _range(spec, state.range), state.doc))  # fmt: skip
    for rotation in spec.rotations:
        for error, expression in zip(rotation.errors, rotation.variances, strict=True):
            variance = _value(spec, expression)
            std = "" if variance is None else figure(variance**0.5)
            doc = f"error of {rotation.name}, as the {rotation.error} sees it"
            rows.append((error, "rad", "rotation", "0", std, "", doc))
    head = ("state", "unit", "kind", "starts at", "± 1 σ", "range", "meaning")
    count = f"{len(spec.states)}" + (f", with {len(spec.errors)} errors" if spec.rotations else "")
    return Grid(f"States ({count})", head, rows, right=(3, 4))


def _firsts(spec: Spec) -> Iterator[tuple[str, str, str]]:
    """Sensor, what it sets, and to what: of a vector as it is written."""
    for rule in spec.initialize:
        for what, given in (("", rule.states), ("var ", rule.variance)):
            for each, formula in given.items():
                written = formula.place.path.rpartition(".")[2] or each
                yield rule.sensor, what + written, plain(formula.text)


def _value(spec: Spec, expression: Expression | None) -> float | None:
    if expression is None:
        return None
    try:
        return float(value(expression.tree, spec))
    except Exception:  # it depends on what only the run knows
        return None


def _std(spec: Spec, state: State) -> float | None:
    i = spec.states.index(state)
    variance = _value(spec, state.variance if spec.P0 is None else spec.P0[i][i])
    return None if variance is None else variance**0.5


def _number(spec: Spec, expression: Expression | None) -> str:
    number = _value(spec, expression)
    return "" if number is None else figure(number, 6)


def _range(spec: Spec, given: Range | None) -> str:
    return "" if given is None else f"{_number(spec, given[0])} … {_number(spec, given[1])}"


def _motion(mode: Spec, title: str) -> Iterator[Block]:
    of = f" of mode {title}" if title else ""
    rows = [equation(name(each.name), each.value) for each in mode.let]
    if rows:
        yield Equations(f"Definitions{of}", rows)
    continuous, f = mode.dynamics.form == "continuous", mode.dynamics.f
    later = "<mrow><mi>k</mi><mo>+</mo><mn>1</mn></mrow>"
    rows = []
    names = [state.name for state in mode.states]
    turning = {part for rotation in mode.rotations if f.keys() & set(rotation.errors) for part in rotation.parts}
    for each in [*names, *(error for error in mode.errors if error not in names)]:
        if each in f:
            left = name(each, later)
            if continuous:  # of a rotation's error: the body's angular rate
                left = f"<mfrac><mrow><mi>d</mi>{name(each)}</mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
            rows.append(equation(left, f[each]))
    still = [each for each in names if each not in f and each not in turning]
    how = f"continuous, {mode.dynamics.integrator}" if continuous else "discrete"
    kept = f"; constant: {', '.join(still)}" if still else ""
    if rows:
        yield Equations(f"Dynamics{of} ({how}{kept})", rows)
    noises = list(_noises(mode.noise))
    Q = mode.dynamics.Q
    if isinstance(Q, Mapping):
        noises += [
            (f"Q.{each}", "added to the state", "variance per step", plain(entry.text)) for each, entry in Q.items()
        ]
    else:
        noises += [(f"Q.{error}", "full matrix, row", "variance per step", ", ".join(plain(e.text) for e in row))
                   for error, row in zip(mode.errors, Q, strict=True)]  # fmt: skip
    if noises:
        yield Grid(f"Process noise{of}", ("noise", "where", "what", "as written"), noises)


def _noises(noises: Sequence[Noise]) -> Iterator[tuple[str, str, str, str]]:
    for noise in noises:
        key = noise.variance.place.path.rpartition(".")[2] if noise.variance is not None else "full covariance"
        text = "" if noise.variance is None else plain(noise.variance.text)
        where = "in the equations" + (f", {noise.unit}" if noise.unit else "")
        yield noise.name, where, "spectral density" if noise.density and key == "density" else key, text


def _sensing(mode: Spec, title: str) -> Iterator[Block]:
    of = f" of mode {title}" if title else ""
    rows = []
    for sensor in mode.measurements:
        for component in sensor.components:
            left = f"<msub><mrow>{name(component.name)}</mrow>{word(sensor.name)}</msub>"
            rows.append(equation(left, component.h))
    yield Equations(f"Measurements{of}", rows)
    yield Grid(
        f"Sensors{of}", ("component", "unit", "noise", "as written", "gate"), list(_components(mode.measurements))
    )


def _components(sensors: Sequence[Sensor]) -> Iterator[tuple[str, str, str, str, str]]:
    for sensor in sensors:
        gate = ""
        if sensor.gate is not None:
            chosen = sensor.gate.probability or sensor.gate.threshold
            kind = "probability" if sensor.gate.probability is not None else "threshold"
            gate = f"{kind} {plain(chosen.text)}" if chosen is not None else ""
        of_rotations = {part: variance for rotation in sensor.rotations
                        for part, variance in zip(rotation.parts[1:], rotation.variances, strict=True)}  # fmt: skip
        for component in sensor.components:
            given = component.variance or of_rotations.get(component.name)
            if component.name in {rotation.parts[0] for rotation in sensor.rotations}:
                yield f"{sensor.name}.{component.name}", "(quaternion)", "", "", gate
                continue
            key = "R" if given is None else given.place.path.rpartition(".")[2]
            text = "" if given is None else plain(given.text)
            unit = component.unit + (f" ({component.kind})" if component.kind != "real" else "")
            yield f"{sensor.name}.{component.name}", unit, key, text, gate
        for known in sensor.inputs:
            yield f"{sensor.name}: {known.name}", known.unit, "given with it", "", ""
        for noise in _noises(sensor.noise):
            yield f"{sensor.name}: {noise[0]}", "", noise[2], noise[3], ""
