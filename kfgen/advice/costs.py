"""What another form of the same filter would cost, where it is likely to be a fraction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from kfgen.errors import Advice, SpecError
from kfgen.spec.types import Spec

if TYPE_CHECKING:
    from kfgen.generate import Generated

FRACTION = 3  # a prediction of full costs a third: it is worth saying
FEW = 1000  # operations that nobody minds
MOST = 40  # states of a filter that is built in another form although loops are what it needs
LARGE, TENTH = 32 * 1024, 10


def cheaper(spec: Spec, generated: Generated) -> Iterator[Advice]:
    """Advice on the form of the covariance, and on loops, by operation counts and predicted flash."""
    if generated.fixed is not None:
        return
    flash, code = generated.summary.prediction.totals["flash"], spec.code
    undecided = code.unroll == "auto" and not code.unroll_by and code.flash is None
    loops = list(_loops(spec, flash)) if flash > LARGE and undecided and "loops" not in spec.advice else []
    yield from loops
    if loops and len(spec.states) > MOST:
        return  # which is the larger matter, and the other takes long to build
    if spec.imm is None and spec.filter.covariance == "ud" and spec.filter.type in ("kf", "ekf"):
        yield from _full(spec, generated)


def _loops(spec: Spec, flash: int) -> Iterator[Advice]:
    other = _built(replace(spec, code=replace(spec.code, unroll="none")))
    least = None if other is None else other.summary.prediction.totals["flash"]
    if least is not None and least * TENTH <= flash:
        text = f"about {flash} bytes of straight-line code, of which loops need about {least}"
        yield Advice(spec.place, text, "write `code: {unroll: none}`, or a budget, `code: {flash: ..}`", "loops")


def _full(spec: Spec, generated: Generated) -> Iterator[Advice]:
    predict, ours = _operations(generated)
    if "ud_cost" in spec.advice or any(form == "loops" for form in generated.summary.forms.values()):
        return
    if ours < FEW or _estimate(generated) * FRACTION > predict:  # then it need not be built to be compared
        return
    joseph = spec.filter.gain_limit is not None or spec.filter.consider
    chosen = replace(spec.filter, covariance="full", update="joseph" if joseph else "standard")
    other = _built(replace(spec, filter=chosen))
    if other is None:
        return
    theirs, all_theirs = _operations(other)
    if theirs * FRACTION <= predict and all_theirs * 2 <= ours:
        text = (
            f"a prediction with `covariance: ud` takes {predict} operations, with `full` {theirs}; with one of each "
            f"update {ours} and {all_theirs}"
        )
        cure = f"write `covariance: full, update: {chosen.update}` where P does not dwarf R, and keep ud where it does"
        place = spec.filter.places.get("covariance", spec.filter.place)
        yield Advice(place if place.line else spec.place, text, cure, "ud_cost")


def _estimate(generated: Generated) -> int:
    """What F P F^T takes, about, with F as sparse as it is."""
    model = generated.code.model
    states = set(model.states)
    beside = sum(len(model.uses(f) & states - {name}) for name, f in zip(model.states, model.f, strict=True))
    return 3 * beside * len(states)


def _operations(generated: Generated) -> tuple[int, int]:
    """Of a prediction, and of one with one of each update."""
    counts = {name: sum(each.values()) for name, each in generated.summary.rows if not name.endswith("_masked")}
    return counts.get("predict", 0), sum(counts.values())


def _built(spec: Spec) -> Generated | None:
    from kfgen.generate import build

    try:
        return build(spec, judge=False)
    except SpecError:
        return None
