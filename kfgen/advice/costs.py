"""What another form of the same filter would cost, where it is likely to be a fraction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from kfgen.errors import Advice, SpecError
from kfgen.spec.types import Spec

if TYPE_CHECKING:
    from kfgen.generate import Generated

FRACTION = 3  # full costs a third: it is worth saying
MOST = 40  # states of a filter that is built in another form although loops are what it needs
LARGE, TENTH = 32 * 1024, 10


def cheaper(spec: Spec, generated: Generated) -> Iterator[Advice]:
    """Advice on the form of the covariance, and on loops, by operation counts and predicted flash."""
    prediction = generated.summary.prediction
    if generated.fixed is not None or prediction is None:
        return
    flash, code = prediction.totals["flash"], spec.code
    undecided = code.unroll == "auto" and not code.unroll_by and code.flash is None
    loops = list(_loops(spec, flash)) if flash > LARGE and undecided and "loops" not in spec.advice else []
    yield from loops
    if loops and len(spec.states) > MOST:
        return  # which is the larger matter, and the other takes long to build
    if spec.imm is None and spec.filter.covariance == "ud" and spec.filter.type in ("kf", "ekf"):
        yield from _full(spec, generated)


def _loops(spec: Spec, flash: int) -> Iterator[Advice]:
    other = _built(replace(spec, code=replace(spec.code, unroll="none")))
    least = None if other is None or other.summary.prediction is None else other.summary.prediction.totals["flash"]
    if least is not None and least * TENTH <= flash:
        text = f"about {flash} bytes of straight-line code, of which loops need about {least}"
        yield Advice(spec.place, text, "write `code: {unroll: none}`, or a budget, `code: {flash: ..}`", "loops")


def _full(spec: Spec, generated: Generated) -> Iterator[Advice]:
    ours = _operations(generated)
    if "ud_cost" in spec.advice or any(form == "loops" for form in generated.summary.forms.values()):
        return
    if _least(generated) * FRACTION > ours:  # then it need not be built to be compared
        return
    other = _built(replace(spec, filter=replace(spec.filter, covariance="full", update="joseph")))
    if other is None:
        return
    theirs = _operations(other)
    if theirs * FRACTION <= ours:
        text = f"`covariance: ud` takes {ours} operations for one of each function, `full` {theirs}"
        cure = "write `covariance: full` where R is not tiny beside P, and keep ud where it is"
        place = spec.filter.places.get("covariance", spec.filter.place)
        yield Advice(place if place.line else spec.place, text, cure, "ud_cost")


def _least(generated: Generated) -> int:
    """What a full covariance takes at least: F P with F as sparse as it is, and P - K H P of each component."""
    model = generated.code.model
    states, n = set(model.states), len(model.states)
    beside = sum(len(model.uses(f) & states - {name}) for name, f in zip(model.states, model.f, strict=True))
    return 2 * beside * n + 3 * sum(len(sensor.h) for sensor in model.sensors) * n * (n + 1) // 2


def _operations(generated: Generated) -> int:
    return sum(sum(counts.values()) for name, counts in generated.summary.rows if not name.endswith("_masked"))


def _built(spec: Spec) -> Generated | None:
    from kfgen.generate import build

    try:
        return build(spec, judge=False)
    except SpecError:
        return None
