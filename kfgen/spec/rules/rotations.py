"""Quaternions: what goes with them, and what does not, with the reason."""

from __future__ import annotations

from fractions import Fraction

from kfgen.spec.operations import less
from kfgen.spec.problems import short
from kfgen.spec.rules.facts import Facts, Model, show
from kfgen.spec.tree import Call
from kfgen.spec.types import Rotation

_LEAST = Fraction(1, 1000)  # of the norm of an initial quaternion
_TYPES = {
    "kf": "an attitude is not linear in its error",
    "ekf2": "second derivatives of a rotation are not those of its error",
}


def check(facts: Facts) -> None:
    models = list(facts.models())
    for model in models:
        for rotation in model.rotations:
            _type(facts, model, rotation, f"the quaternion {short(rotation.name)}")
            if all(each.filter.type == "iekf" for each in models):
                _reset(facts, rotation)
            _init(facts, model, rotation)
        for sensor in model.measurements:
            for rotation in () if model.rotations else sensor.rotations:
                _type(facts, model, rotation, f"the measured quaternion {short(rotation.name)}")


def _type(facts: Facts, model: Model, rotation: Rotation, what: str) -> None:
    why = _TYPES.get(model.filter.type)
    if why is not None:
        at = model.filter.places.get("type", model.filter.place)
        text = f"`type: {model.filter.type}` does not go with {what}: {why}"
        facts.add(at, text, "choose `type: ekf`, `iekf` or `ukf`")


def _reset(facts: Facts, rotation: Rotation) -> None:
    path = f"states.{rotation.name}.reset"
    if facts.written(path):
        text = "`reset` does not go with an iekf: its last linearisation is at the new attitude already"
        facts.add(facts.at(path), text, "remove `reset`")


def _init(facts: Facts, model: Model, rotation: Rotation) -> None:
    """What is normalised must have a length."""
    init = next(state.init for state in model.states if state.name == rotation.parts[0])
    if not isinstance(init.tree, Call) or init.tree.op != "div":
        return  # of length 1, or with a mistake of its own
    norm = facts.tree(init.tree.args[1], facts.folded)
    if norm is not None and less(norm, _LEAST):
        text = f"the norm of the initial quaternion is {show(norm)}, which is too small to be normalised"
        facts.add(init.place, text, "write [1, 0, 0, 0] for no rotation")
