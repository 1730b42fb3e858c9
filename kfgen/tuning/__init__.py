"""Fitting the numbers of a spec to logs: by the likelihood of the innovations, or by the error against the truth."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from kfgen.errors import KfgenError, SpecError
from kfgen.logs import Source, as_log
from kfgen.spec.types import Spec
from kfgen.tuning.curvature import Curvature, curvature
from kfgen.tuning.numbers import Slot, default_slots, slot_of, written
from kfgen.tuning.objective import Objective, Score
from kfgen.tuning.opened import opened
from kfgen.tuning.search import Advance, Coordinates, Search, units_of
from kfgen.tuning.writing import rounded, with_numbers

OBJECTIVES = ("likelihood", "rmse")
HOLDOUT = 0.2


@dataclass(frozen=True)
class Tuned:
    """What a tuning found. slots: the numbers, values: their new ones. before, after: the scores; curvature: None where
    it was interrupted, or where the objective is no likelihood."""

    spec: Spec
    slots: tuple[Slot, ...]
    values: tuple[float, ...]
    before: Score
    after: Score
    curvature: Curvature | None
    holdout: float
    interrupted: bool
    trials: int

    def text(self) -> str:
        """The spec's own text with the new numbers. KfgenError where the file has changed, or is none."""
        try:
            data = Path(self.spec.file).read_bytes()
        except OSError as error:
            raise KfgenError(f"{self.spec.file}: the spec cannot be read again: {error.strerror or error}") from None
        if sha256(data).hexdigest() != self.spec.sha256:
            raise KfgenError(f"{self.spec.file}: the file has changed since it was read")
        return with_numbers(data.decode("utf-8"), self.slots, self.values)

    def as_json(self) -> dict[str, Any]:
        """Plain data, as `kfgen tune --json` prints it; what is not known is null."""
        found = self.curvature
        k = len(self.slots)
        errors = np.full(k, math.nan) if found is None else found.errors
        held = self.holdout > 0
        before, after = self.before, self.after
        return {
            "parameters": [
                {"path": slot.path, "old": slot.value, "new": new, "std_error": _known(error)}
                for slot, new, error in zip(self.slots, self.values, errors.tolist(), strict=True)
            ],
            "log_likelihood": {
                "before": before.likelihood[0], "after": after.likelihood[0],
                "holdout_before": before.likelihood[1] if held else None,
                "holdout_after": after.likelihood[1] if held else None,
            },
            "nis": {
                name: {
                    "before": _known(before.nis[name][0]), "after": _known(after.nis[name][0]),
                    "holdout_before": _known(before.nis[name][1]), "holdout_after": _known(after.nis[name][1]),
                }
                for name in before.nis
            },
            "correlation": None if found is None else [[_known(c) for c in row] for row in found.correlations.tolist()],
            "unidentified": [] if found is None else list(found.unidentified),
            "holdout": self.holdout,
            "trials": self.trials,
            "interrupted": self.interrupted,
        }  # fmt: skip


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None


def tuned(
    spec: Spec,
    logs: Sequence[Source],
    free: Sequence[str] = (),
    objective: str = "likelihood",
    holdout: float = HOLDOUT,
    robust: bool = False,
    advance: Advance = lambda done, what: None,
) -> Tuned:
    """Fit numbers of a spec to logs.

    free: their paths; without, all noises that stand in the spec as numbers. objective: likelihood, or rmse against the
    logs' columns true.<state>. holdout: the share of rows at the end of each log that is judged, not fitted. robust:
    let no outlier pull more than one at the 99.9 % limit. Raises KfgenError; SpecError of the spec.
    """
    if objective not in OBJECTIVES:
        raise KfgenError(f"there is no objective `{objective}`; choose {' or '.join(OBJECTIVES)}")
    if not 0.0 <= holdout < 1.0:
        raise KfgenError(f"the share that is held out is at least 0 and below 1, not {holdout:g}")
    if not logs:
        raise KfgenError("no log is given to tune by")
    known = written(spec)
    slots = [slot_of(spec, path, known) for path in free] if free else default_slots(spec)
    if not slots:
        raise KfgenError(
            f"{spec.name} has no noise whose size stands in it as a number above 0; name what to tune: --free"
        )
    places = [{(place.line, place.column) for place, _ in slot.spots} for slot in slots]
    doubled = [slot.path for i, slot in enumerate(slots) if any(places[i] & earlier for earlier in places[:i])]
    if doubled:
        raise KfgenError(f"--free: {doubled[0]} is named twice")
    data = [as_log(log, spec) for log in logs]
    unfolded = opened(spec, slots)
    if unfolded.start and (spec.imm is not None or spec.filter.gain is not None):
        raise KfgenError("a number of the start cannot be tuned here: a bank's modes have starts of their own")
    try:
        judge = Objective(unfolded, data, holdout, objective, robust)
    except SpecError as error:
        listed = ", ".join(slot.path for slot in slots)
        raise KfgenError(
            f"{listed} cannot all be tuned, since code is generated for the number itself:\n{error}"
        ) from None
    return searched(spec, slots, judge, advance)


def searched(spec: Spec, slots: Sequence[Slot], judge: Objective, advance: Advance = lambda done, what: None) -> Tuned:
    """The best values of slots by an objective made for them."""
    start = [slot.value for slot in slots]
    before = judge.scores([start])[0]
    search = Search(judge, Coordinates(slots, units_of(judge, slots)), advance)
    search.climb()
    found: Curvature | None = None
    values = search.coordinates.numbers(search.best)
    if not search.interrupted and judge.kind == "likelihood":
        try:
            found = curvature(search)
            for i, highest in found.loose.items():
                # what the data leave open stays what it was where that fits; else as large as fits, not as small
                values[i] = min(slots[i].value, highest) if slots[i].positive else values[i]
        except KeyboardInterrupt:
            search.interrupted = True
    values = [rounded(number) for number in values]
    after = judge.scores([values])[0]
    return Tuned(
        spec, tuple(slots), tuple(values), before, after, found, judge.holdout, search.interrupted, judge.trials
    )


def tune(
    spec: Spec | str | os.PathLike[str], logs: Sequence[Source] | Source, free: Sequence[str] = (), **options: Any
) -> dict[str, Any]:
    """What `kfgen tune --json` prints, as data. logs: a log or several; options: those of `tuned`."""
    if not isinstance(spec, Spec):
        from kfgen.spec import load

        spec = load(os.fspath(spec))
    several: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    return tuned(spec, several, free, **options).as_json()
