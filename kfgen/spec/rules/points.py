"""Sigma points: weights that exist, custom points of the right shape, points that can be kept."""

from __future__ import annotations

from fractions import Fraction

from kfgen.spec.affine import Affine
from kfgen.spec.matrices import close
from kfgen.spec.operations import Value, apply
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD
from kfgen.spec.rules.facts import Facts, Model, show
from kfgen.spec.types import Sensor, SigmaPoints


def check_points(facts: Facts, model: Model, points: SigmaPoints) -> None:
    path = f"{model.filter.place.path}.sigma_points"
    _gamma(facts, model, points)
    if points.kind == "custom":
        _custom(facts, model, points, path)
    if not points.redraw:
        _kept(facts, model, path)


def _gamma(facts: Facts, model: Model, points: SigmaPoints) -> None:
    """The squared spread must be positive; it is smallest for the fewest dimensions, the states."""
    if points.alpha is not None:
        alpha = facts.check_range(points.alpha, "alpha", 0)
        if alpha is None:
            return
    kappa = facts.value(points.kappa)
    if kappa is None or points.kappa is None or not model.states:
        return
    count = len(model.errors)
    if points.kind == "wiki":
        facts.check_range(points.kappa, "kappa", 0)
        return
    gamma: Value = apply("add", [Fraction(count), kappa])
    if gamma <= 0:
        text = f"n + kappa must be positive, but is {count} + {show(kappa)}"
        facts.add(points.kappa.place, text, f"choose kappa > -{count}")


def _custom(facts: Facts, model: Model, points: SigmaPoints, path: str) -> None:
    count = len(model.errors)
    if points.points is None or not count:
        return
    place = facts.at(f"{path}.points", otherwise=model.filter.place)
    if not points.points:
        facts.add(place, "there are no points", "write one row per point")
        return
    what = "coordinates of the error" if model.rotations else "states"
    for i, row in enumerate(points.points):
        if len(row) != count:
            at = facts.walker.value_place(f"{path}.points[{i}]", place)
            text = f"point {i + 1} has {len(row)} coordinates, but there are {count} {what}"
            facts.add(at, text, f"write {count} numbers per point")
            return
    for key, weights in (("wm", points.wm), ("wc", points.wc)):
        if weights is not None and len(weights) != len(points.points):
            at = facts.at(f"{path}.{key}", otherwise=place)
            text = f"`{key}` has {len(weights)} weights, but there are {len(points.points)} points"
            facts.add(at, text, "write one weight per point")
            return
    _moments(facts, points, path)
    if model.filter.augment and (model.noise or any(s.noise for s in model.measurements)):
        at = facts.at(f"{model.filter.place.path}.augment", otherwise=place)
        text = "`augment` does not go with custom points: they have no columns for the noises"
        facts.add(at, text, "choose other sigma points, or remove `augment`")
    centre = any(all(facts.value(entry) == 0 for entry in row) for row in points.points)
    if model.filter.reject is not None and not centre:
        at = facts.at(f"{model.filter.place.path}.reject", otherwise=place)
        facts.add(at, "`reject` needs a centre point, a row of zeros, to replace others by", "add one")


def _moments(facts: Facts, points: SigmaPoints, path: str) -> None:
    weights = [facts.value(weight) for weight in points.wm or ()]
    if not weights or any(weight is None for weight in weights):
        return
    total = Fraction(0)
    for weight in weights:
        total = apply("add", [total, weight])
    if not close(total, Fraction(1), 1):
        text = f"the weights of the mean sum to {show(total)}, not to 1"
        facts.add(facts.at(f"{path}.wm"), text, "scale them")


def _kept(facts: Facts, model: Model, path: str) -> None:
    """redraw: false keeps the points of predict for one update, without noise dimensions of a measurement."""
    place = facts.at(f"{path}.redraw", otherwise=model.filter.place)
    if len(model.measurements) > 1:
        text = f"`redraw: false` keeps points for one sensor, but there are {len(model.measurements)}"
        facts.add(place, text, "remove it")
        return
    for sensor in model.measurements:
        if sensor.noise and (model.filter.augment or not _noise_is_additive(model, sensor)):
            text = f"`redraw: false` does not go with augmented noise of {short(sensor.name)}"
            facts.add(place, text, "remove it")


def _noise_is_additive(model: Model, sensor: Sensor) -> bool:
    """Whether a sensor's noises enter linearly, with coefficients that contain no state."""
    states = {state.name for state in model.states}
    affine = Affine(model.context, frozenset(n.name for n in sensor.noise))
    for component in sensor.components:
        if component.h.tree == BAD:
            continue
        form = affine.form(component.h.tree)
        if form.depends and (not form.affine or form.coefficients & states):
            return False
    return True
