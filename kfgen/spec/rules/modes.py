"""Interacting multiple models: probabilities, and what all modes must have in common."""

from __future__ import annotations

from fractions import Fraction

from kfgen.errors import Place
from kfgen.spec.matrices import close
from kfgen.spec.operations import Value, apply, less
from kfgen.spec.problems import short
from kfgen.spec.rules.facts import Facts, show
from kfgen.spec.tree import Expression
from kfgen.spec.types import Imm, Sensor

_LEAST, _MOST = 2, 8


def check(facts: Facts) -> None:
    imm = facts.spec.imm
    if imm is None:
        return
    count = len(imm.modes)
    if facts.broken("imm.modes") or "imm.modes" in facts.walker.meant or not facts.written("imm.modes"):
        return
    if not _LEAST <= count <= _MOST:
        text = f"an imm has {_LEAST} to {_MOST} modes, not {count}"
        facts.add(
            facts.at("imm.modes"),
            text,
            "for a single model write no `imm`" if count < 2 else "leave some out",
        )
        return
    _transition(facts, imm)
    _initial(facts, imm)
    _sensors(facts, imm)
    _steady(facts, imm)


def _probabilities(facts: Facts, entries: tuple[Expression, ...], place: Place, what: str) -> None:
    """Not negative, and summing to 1."""
    total: Value = Fraction(0)
    constant = True
    for entry in entries:
        number = facts.value(entry)
        if number is None:  # with the spec's parameters, where these and a fixed dt are all that it uses
            constant = False
            number = facts.value(entry, facts.folded)
            if number is None:
                continue
        if number < 0 or number > 1:
            facts.add(entry.place, f"the probability {show(number)} is not between 0 and 1", "correct it")
            return
        total = apply("add", [total, number])
    if constant and not close(total, Fraction(1), 1):
        facts.add(place, f"{what} sums to {show(total)}, not to 1", "write thirds as 1/3")


def _transition(facts: Facts, imm: Imm) -> None:
    count = len(imm.modes)
    place = facts.at("imm.transition", otherwise=imm.place)
    if (
        facts.broken("imm.transition")
        or not facts.written("imm.transition")
        or not (imm.transition or facts.empty("imm.transition"))
    ):
        return
    for i, row in enumerate(imm.transition):
        if len(row) != count:
            at = facts.walker.value_place(f"imm.transition[{i}]", place)
            facts.add(
                at,
                f"row {i + 1} has {len(row)} entries, but there are {count} modes",
                f"write {count} entries",
            )
            return
    if len(imm.transition) != count:
        text = f"`transition` has {len(imm.transition)} rows, but there are {count} modes"
        facts.add(place, text, f"write {count} rows")
        return
    for i, row in enumerate(imm.transition):
        at = facts.walker.value_place(f"imm.transition[{i}]", place)
        _probabilities(facts, row, at, f"row {i + 1} of `transition`")


def _initial(facts: Facts, imm: Imm) -> None:
    count = len(imm.modes)
    place = facts.at("imm.mu0", otherwise=imm.place)
    if len(imm.mu0) != count:
        text = f"`mu0` has {len(imm.mu0)} entries, but there are {count} modes"
        facts.add(place, text, f"write {count} entries")
    else:
        _probabilities(facts, imm.mu0, place, "`mu0`")
    floor = facts.value(imm.mu_floor)
    if floor is not None and (floor < 0 or not less(floor, Fraction(1, count))):
        text = f"`mu_floor` must be at least 0 and less than 1/{count}, not {show(floor)}"
        facts.add(imm.mu_floor.place, text, "the default is 1e-9")


def _sensors(facts: Facts, imm: Imm) -> None:
    """All modes see the same measurements: an update takes one z, whatever the mode."""
    wanted = facts.spec.measurements
    for mode in imm.modes:
        if mode.measurements is wanted or not mode.measurements or not wanted:
            continue
        place = facts.at(f"imm.modes.{mode.name}.measurements", otherwise=mode.place)
        if _shape(mode.measurements) != _shape(wanted):
            text = f"the mode {short(mode.name)} has other sensors or components than the spec"
            facts.add(place, text, "write " + _listed(wanted))
            continue
        for own, other in zip(mode.measurements, wanted, strict=True):
            if own.partial != other.partial:
                at = facts.at(f"{own.place.path}.partial", otherwise=own.place)
                facts.add(at, f"`partial` of {short(own.name)} differs between modes", "write the same in all")
            kinds = [(a.kind, b.kind) for a, b in zip(own.components, other.components, strict=True)]
            if any(a != b for a, b in kinds):
                facts.add(own.place, f"`kind` in {short(own.name)} differs between modes", "write the same in all")
            if [r.error for r in own.rotations] != [r.error for r in other.rotations]:
                facts.add(own.place, f"`error` in {short(own.name)} differs between modes", "write the same in all")


def _steady(facts: Facts, imm: Imm) -> None:
    """A steady-state gain belongs to a covariance that no mixing changes: after a switch, when the spread between the
    modes ought to raise it, such a mode would trust its mixed state as if nothing had happened."""
    steady = [mode.filter for mode in imm.modes if mode.filter.gain == "steady"]
    for place in dict.fromkeys(options.places.get("gain", options.place) for options in steady):
        facts.add(
            place, "`gain: steady` does not go with imm: mixing the modes changes their covariances", "remove `gain`"
        )


def _shape(sensors: tuple[Sensor, ...]) -> list[tuple[str, list[str]]]:
    return [(sensor.name, [each.name for each in sensor.fields]) for sensor in sensors]


def _listed(sensors: tuple[Sensor, ...]) -> str:
    return "; ".join(f"{s.name}: {', '.join(each.name for each in s.fields)}" for s in sensors)
