"""Values of constant formulas: that they exist, that they are in range, that limits are ordered."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

from kfgen.scalar_names import DOUBLE, FLOAT
from kfgen.spec.constants import NotConstant, truth, value
from kfgen.spec.expressions import MAX_EXPONENT
from kfgen.spec.operations import NoValue, Value, apply, less
from kfgen.spec.rules.facts import Facts, Model, show
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Call, Name, Number, Tree
from kfgen.spec.types import Filter, Range, Sensor

_LARGEST = {FLOAT: Fraction(2) ** 128, DOUBLE: Fraction(2) ** 1024}

# names of constants that mean something else: the innovation, components of sensors
_HIDDEN = {"psi": ("e",), "initialize": ("pi", "e", "dt", "t")}


def check(facts: Facts) -> None:
    _foldable(facts)
    _whole_numbers(facts)
    _step(facts)
    _ranges(facts)
    for model in facts.models():
        _initial(facts, model)
        for sensor in model.measurements:
            _sensor(facts, sensor)
        _filter(facts, model.filter)
    _scale(facts)


# --- folding


def _foldable(facts: Facts) -> None:
    """Constant parts of every formula have a finite value; integer exponents are small."""
    for written in facts.walker.formulas:
        for context in facts.scopes.users(written.path):
            known = facts.folded if written.scope == "folded" else facts.known(context)
            if written.scope == "psi":
                known = {name: v for name, v in known.items() if name != "e"}
            if written.scope == "initialize":  # components hide other names
                known = {}
            largest = _LARGEST.get(DOUBLE if written.path[0] == "constants" else facts.spec.scalar)
            for part in written.parts:
                try:
                    number = _fold(part.tree, known, hidden=_HIDDEN.get(written.scope, ()))
                except NoValue as error:
                    facts.add(part.place, error.message, error.hint)
                    continue
                if number is not None and largest is not None and not less(abs(number), largest):
                    text = f"the value {show(number)} is too large for {facts.spec.scalar}"
                    facts.add(part.place, text, "choose other units, or `scalar: double`")


def _fold(tree: Tree, known: dict[str, Value], hidden: tuple[str, ...] = ()) -> Value | None:
    """The value of a tree, or None where it is not constant; NoValue where a constant part of it has none."""
    if isinstance(tree, Number):
        return tree.value
    if isinstance(tree, Name):
        if tree.name in hidden:
            return None
        return value(tree) if tree.name in ("pi", "e") else known.get(tree.name)
    if tree.op == "where":
        return _fold_where(tree, known, hidden)
    if tree.op in ("lt", "le", "gt", "ge", "and", "or", "not"):
        for argument in tree.args:
            _fold(argument, known, hidden)
        return None
    arguments = [_fold(argument, known, hidden) for argument in tree.args]
    if tree.op == "pow" and arguments[1] is not None:
        exponent = arguments[1]
        if exponent == apply("floor", [exponent]) and abs(exponent) > MAX_EXPONENT:
            raise NoValue(f"an integer exponent may be at most {MAX_EXPONENT} in size", "use a smaller one")
    if tree.op == "div" and arguments[1] is not None and arguments[1] == 0:
        raise NoValue("the expression divides by zero", "write a divisor that is not 0")
    if tree.op == "table":
        half = 1 + len(arguments) // 2
        xs = [x for x in arguments[1:half] if x is not None]
        if any(not less(a, b) for a, b in pairwise(xs)):
            raise NoValue("the first list of `table` does not increase", "sort the points")
    if any(argument is None for argument in arguments):
        return None
    return apply(tree.op, arguments)


def _fold_where(tree: Call, known: dict[str, Value], hidden: tuple[str, ...]) -> Value | None:
    """Only the selected branch counts; where that is not known before run time, neither is judged."""
    _fold(tree.args[0], known, hidden)
    if hidden:
        return None
    try:
        chosen = truth(tree.args[0], known)
    except NotConstant:
        return None
    return _fold(tree.args[1] if chosen else tree.args[2], known, hidden)


def _whole_numbers(facts: Facts) -> None:
    for expression, shape in facts.walker.whole:
        number = facts.value(expression)
        if number is None:
            continue
        key = expression.place.path.rpartition(".")[2]
        if key == "kfgen" and number != 1:
            facts.add(expression.place, f"version {show(number)} of the language is not known", "write `kfgen: 1`")
        elif number != apply("floor", [number]):
            facts.add(expression.place, f"`{key}` is {show(number)}", "write a whole number")
        elif number < shape.low or (shape.high is not None and number > shape.high):
            limits = f"between {shape.low} and {shape.high}"
            if shape.high is None or shape.high > 10**9:
                limits = f"at least {shape.low}"
            facts.add(expression.place, f"`{key}` is {show(number)}", f"write a whole number {limits}")


# --- ranges


def _step(facts: Facts) -> None:
    step = facts.spec.dt
    if step is None:
        return
    nominal = facts.check_range(step.nominal, "the step", 0)
    low = facts.check_range(step.minimum, "the smallest step", 0)
    high = facts.check_range(step.maximum, "the largest step", 0)
    if step.minimum and step.maximum and low is not None and high is not None and less(high, low):
        facts.add(step.maximum.place, f"`max` ({show(high)}) is smaller than `min` ({show(low)})", "swap them")
        return
    if step.minimum and nominal is not None and low is not None and less(nominal, low):
        text = f"`nominal` ({show(nominal)}) is smaller than `min` ({show(low)})"
        facts.add(step.nominal.place, text, "write min <= nominal <= max")
    if step.maximum and nominal is not None and high is not None and less(high, nominal):
        text = f"`nominal` ({show(nominal)}) is larger than `max` ({show(high)})"
        facts.add(step.nominal.place, text, "write min <= nominal <= max")


def _ordered(facts: Facts, limits: Range | None, what: str) -> bool:
    if limits is None:
        return False
    low, high = facts.value(limits[0]), facts.value(limits[1])
    if low is None or high is None:
        return False
    if less(low, high):
        return True
    text = f"the {what} [{show(low)}, {show(high)}] is not in order"
    facts.add(limits[0].place, text, "write the smaller number first")
    return False


def _ranges(facts: Facts) -> None:
    spec = facts.spec
    ranges = [p.range for p in spec.parameters] + [i.range for i in spec.inputs] + [s.range for s in spec.states]
    for limits in ranges:
        _ordered(facts, limits, "range")
    for state in spec.states:
        _ordered(facts, state.bounds, "pair of bounds")
        if state.kind == "periodic":
            facts.check_range(state.period, "the period", 0)


def _initial(facts: Facts, model: Model) -> None:
    """init lies within the bounds (an angle after it has been wrapped)."""
    for state in model.states:
        init = facts.value(state.init, facts.folded)
        if init is None or state.bounds is None:
            continue
        low, high = facts.value(state.bounds[0]), facts.value(state.bounds[1])
        if low is None or high is None or not less(low, high):
            continue
        period = facts.value(state.period)
        if period is not None and period > 0:
            turns = -apply("floor", [apply("sub", [Fraction(1, 2), apply("div", [init, period])])])
            init = apply("sub", [init, apply("mul", [turns, period])])
        if less(init, low) or less(high, init):
            text = f"init {show(init)} lies outside the bounds [{show(low)}, {show(high)}]"
            facts.add(state.init.place, text, "choose an init within them")


def _sensor(facts: Facts, sensor: Sensor) -> None:
    for component in sensor.components:
        _ordered(facts, component.range, "range")
        if component.kind == "periodic":
            facts.check_range(component.period, "the period", 0)
    facts.check_range(sensor.rate, "the rate", 0)
    if sensor.gate is not None:
        facts.check_range(sensor.gate.probability, "the probability", 0, 1)
        facts.check_range(sensor.gate.threshold, "the threshold", 0)
    if sensor.own:
        _update(facts, filter_of(Filter(), sensor))


def _update(facts: Facts, chosen: Filter) -> None:
    """The options that a sensor may have of its own."""
    if chosen.adaptive is not None:
        facts.check_range(chosen.adaptive.probability, "the probability", 0, 1)
        facts.check_range(chosen.adaptive.chi2, "the threshold", 0)
    if chosen.robust is not None:
        facts.check_range(chosen.robust.k, "`k`", 0)
    facts.check_range(chosen.adapt_R, "a forgetting factor", 0, 1)


def _filter(facts: Facts, chosen: Filter) -> None:
    _update(facts, chosen)
    facts.check_range(chosen.adapt_Q, "a forgetting factor", 0, 1)
    facts.check_range(chosen.innovation_floor, "the smallest innovation variance", 0)
    facts.check_range(chosen.gain_limit, "the largest gain", 0)
    for name, floor in chosen.variance_floor.items():
        low = facts.check_range(floor, "the smallest variance", 0, strict=False)
        ceiling = chosen.variance_ceiling.get(name)
        high = facts.value(ceiling)
        if low is not None and high is not None and high > 0 and ceiling is not None and not less(low, high):
            text = f"the ceiling {show(high)} does not lie above the floor {show(low)}"
            facts.add(ceiling.place, text, "write a larger ceiling")
    for ceiling in dict.fromkeys(chosen.variance_ceiling.values()):
        facts.check_range(ceiling, "the largest variance", 0)


def _scale(facts: Facts) -> None:
    for scale in (facts.spec.fixed.scale or {}).values():
        number = facts.check_range(scale, "the unit", 0)
        if number is not None and not _power_of_two(number):
            text = f"the unit {show(number)} is not a power of two"
            facts.add(scale.place, text, "write 2**k, such as 64 or 2**-3")


def _power_of_two(number: Value) -> bool:
    if not isinstance(number, Fraction):
        return False
    n, d = number.numerator, number.denominator
    return n & (n - 1) == 0 and d & (d - 1) == 0
