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
LARGE, TENTH = 32 * 1024, 10
MANY = 1000  # operations of a ud filter from which the other form is built to be compared


def cheaper(spec: Spec, generated: Generated) -> Iterator[Advice]:
    """Advice on the form of the covariance, and on loops, by operation counts and predicted flash."""
    prediction = generated.summary.prediction
    if generated.fixed is not None or prediction is None:
        return
    flash = prediction.totals["flash"]
    if flash > LARGE and spec.code.unroll == "auto" and not spec.code.unroll_by and spec.code.flash is None:
        yield from _loops(spec, flash)
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
    if "ud_cost" in spec.advice or ours < MANY or any(form == "loops" for form in generated.summary.forms.values()):
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


def _operations(generated: Generated) -> int:
    return sum(sum(counts.values()) for name, counts in generated.summary.rows if not name.endswith("_masked"))


def _built(spec: Spec) -> Generated | None:
    from kfgen.generate import build

    try:
        return build(spec, judge=False)
    except SpecError:
        return None
