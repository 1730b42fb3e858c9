"""Advice on single values: outside of what the spec says of them, in degrees, a variance where a deviation is asked."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from fractions import Fraction

from kfgen.errors import Advice, Place
from kfgen.scalar_names import DOUBLE
from kfgen.spec.advice.usage import closure
from kfgen.spec.constants import NotConstant, environment_of, value
from kfgen.spec.modes import mode_specs
from kfgen.spec.operations import NoValue, less
from kfgen.spec.parts import expressions
from kfgen.spec.problems import short
from kfgen.spec.raw import key_of
from kfgen.spec.tree import Call, Expression, Name, Number, Tree, names
from kfgen.spec.types import Range, Rotation, Spec

_DEGREES = re.compile(r"\s*(?:deg|degs|degree|degrees|dps|\N{DEGREE SIGN})\s*(?:/.*)?\Z", re.IGNORECASE)
_VARIANCE = re.compile(r"(?:var|variance)(?:_?\w*)?\Z|\w*(?:_sq|_squared|_var|_variance)\Z|(?:sigma|std)\w*?_?2\Z")
_DEVIATION = re.compile(r"(?:std|sigma|stddev)(?:_\w*)?\Z")
_TRIGONOMETRIC = ("sin", "cos", "tan")
_ARC = ("atan2", "atan", "asin", "acos")
_TURN = 2 * math.pi


def advice(spec: Spec) -> Iterator[Advice]:
    known = {name: float(number) for name, number in environment_of(spec).items()}
    yield from _ranges(spec, known)
    for mode in mode_specs(spec):
        yield from _alpha(mode)
        yield from _angles(mode, known)
        yield from _rotations((*mode.rotations, *(r for s in mode.measurements for r in s.rotations)), known)
        yield from _trigonometry(mode, known)
    yield from _deviations(spec)


def _number(expression: Expression | None, known: dict[str, float]) -> float | None:
    return None if expression is None else _value(expression.tree, known)


def _value(tree: Tree, known: dict[str, float]) -> float | None:
    try:
        return float(value(tree, {name: Fraction(number) for name, number in known.items()}))
    except (NotConstant, NoValue):
        return None


def _alpha(mode: Spec) -> Iterator[Advice]:
    points = mode.filter.sigma_points
    if points is None or points.alpha is None or mode.scalar == DOUBLE:
        return
    try:
        alpha = value(points.alpha.tree, mode)
    except (NotConstant, NoValue):
        return
    if less(alpha, Fraction(1, 20)):
        text = f"alpha below 0.05 makes weights that {mode.scalar} cannot carry"
        yield Advice(points.alpha.place, text, "choose alpha between 0.05 and 1, or `scalar: double`", "alpha")


def _ranges(spec: Spec, known: dict[str, float]) -> Iterator[Advice]:
    """Initial values outside of what is said of them (outside of `bounds` is a mistake of its own)."""
    told = [("init", s.init, s.range, s.period) for mode in mode_specs(spec) for s in mode.states]
    told += [("the value", p.value, p.range, None) for p in spec.parameters]
    for what, given, limits, period in told:
        number, ends = _number(given, known), _ends(limits, known)
        turn = _number(period, known)
        if number is None or ends is None:
            continue
        if turn:
            number = math.remainder(number, turn)
        low, high = ends
        slack = 1e-9 * max(abs(low), abs(high))
        if not low - slack <= number <= high + slack:
            text = f"{what} {number:g} lies outside its range [{low:g}, {high:g}]"
            yield Advice(given.place, text, "widen the range, or correct it", "init_range")


def _ends(limits: Range | None, known: dict[str, float]) -> tuple[float, float] | None:
    low, high = (None, None) if limits is None else (_number(limits[0], known), _number(limits[1], known))
    return None if low is None or high is None else (low, high)


def _angles(mode: Spec, known: dict[str, float]) -> Iterator[Advice]:
    """Angles with numbers that only degrees have."""
    cure = "write it in rad (`*pi/180`), or declare `kind: {periodic: 360}`"
    for state in mode.states:
        if state.kind != "angle":
            continue
        init, variance = _number(state.init, known), _number(state.variance, known)
        if init is not None and abs(init) > _TURN:
            yield Advice(state.init.place, f"the angle {init:g} rad is more than a turn: degrees?", cure, "degrees")
        if variance is not None and state.variance is not None and variance > _TURN**2:
            text = f"the standard deviation {math.sqrt(variance):g} rad is more than a turn: degrees?"
            yield Advice(state.variance.place, text, cure, "degrees")
        for limits in (state.range, state.bounds):
            ends = _ends(limits, known)
            if limits is not None and ends is not None and max(map(abs, ends)) > 2 * _TURN:
                text = f"the angle's limits [{ends[0]:g}, {ends[1]:g}] are more than a turn: degrees?"
                yield Advice(limits[0].place, text, cure, "degrees")
    for sensor in mode.measurements:
        for component in sensor.components:
            variance = _number(component.variance, known)
            if component.variance is None or variance is None or component.kind != "angle":
                continue
            if variance > math.pi**2:
                text = f"the standard deviation {math.sqrt(variance):g} rad is more than half a turn: degrees?"
                yield Advice(component.variance.place, text, cure, "degrees")


def _rotations(rotations: tuple[Rotation, ...], known: dict[str, float]) -> Iterator[Advice]:
    for rotation in rotations:
        for variance in rotation.variances:
            number = _number(variance, known)
            if variance is not None and number is not None and number > 4 * math.pi**2:
                text = f"the rotation error {math.sqrt(number):g} rad is more than a turn: degrees?"
                yield Advice(variance.place, text, "write it in rad (`*pi/180`)", "degrees")


def _trigonometry(mode: Spec, known: dict[str, float]) -> Iterator[Advice]:
    """What has the unit deg inside of a sine, and an arc whose unit is to be deg, without a conversion."""
    units = {s.name: s.unit for s in mode.states} | {i.name: i.unit for i in mode.inputs}
    units |= {p.name: p.unit for p in mode.parameters}
    of_degrees = {name for name, unit in units.items() if _DEGREES.match(unit)}
    constants = {constant.name for constant in mode.constants} | {"pi"}
    formulas = [*mode.dynamics.f.values(), *(d.value for d in mode.let)]
    formulas += [component.h for sensor in mode.measurements for component in sensor.components]
    for formula in formulas:
        for call in _calls(formula.tree):
            if call.op not in _TRIGONOMETRIC:
                continue
            inside = closure(names(call.args[0]), mode.let)
            if inside & of_degrees and not inside & constants and not _converts(call.args[0]):
                name = min(inside & of_degrees)
                text = f"`{call.op}` of {short(name)}, whose unit is degrees"
                yield Advice(formula.place, text, f"write `{call.op}({name}*pi/180)`, or give it in rad", "degrees")
    for sensor in mode.measurements:
        for component in sensor.components:
            tree = component.h.tree
            if _DEGREES.match(component.unit) and isinstance(tree, Call) and tree.op in _ARC:
                text = f"`{tree.op}` gives rad, but the unit of {short(component.name)} is degrees"
                yield Advice(component.h.place, text, "multiply it by 180/pi, or give the unit rad", "degrees")


def _calls(tree: Tree) -> Iterator[Call]:
    if isinstance(tree, Call):
        yield tree
        for argument in tree.args:
            yield from _calls(argument)


def _converts(tree: Tree) -> bool:
    """Whether a number of a formula turns degrees into rad."""
    if isinstance(tree, Number):
        number = abs(float(tree.value))
        return number in (180, 360) or any(abs(number / known - 1) < 0.01 for known in (math.pi / 180, 180 / math.pi))
    return isinstance(tree, Call) and any(map(_converts, tree.args))


def _deviations(spec: Spec) -> Iterator[Advice]:
    for formula in expressions(spec):
        key = key_of(formula.place.path)
        if key in ("std", "root_density"):
            tree = formula.tree  # the square of what was written
            written = tree.args[0] if isinstance(tree, Call) and tree.op == "pow" else tree
            if _is_square(written) or (isinstance(written, Name) and _VARIANCE.match(written.name)):
                text = f"{short(formula.text)} looks like a variance, but `{key}` is its root"
                cure = "write `var`" if key == "std" else "write `density`"
                yield _told(formula.place, text, cure)
        elif key in ("var", "density") and isinstance(formula.tree, Name) and _DEVIATION.match(formula.tree.name):
            text = f"{short(formula.text)} looks like a standard deviation, but `{key}` is its square"
            yield _told(formula.place, text, "write `std`" if key == "var" else "write `root_density`")


def _told(place: Place, text: str, cure: str) -> Advice:
    return Advice(place, text, cure, "std_variance")


def _is_square(tree: Tree) -> bool:
    """x**2 of a name or a number, or x*x."""
    if not isinstance(tree, Call):
        return False
    if tree.op == "pow":
        return tree.args[1] == Number(Fraction(2))
    return tree.op == "mul" and tree.args[0] == tree.args[1]
