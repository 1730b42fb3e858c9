"""What is allowed but probably not meant, as far as the spec alone tells: advice, which stops nothing."""

from __future__ import annotations

from collections.abc import Iterable

from kfgen.errors import Advice
from kfgen.spec.advice import usage, values
from kfgen.spec.types import Spec


def warnings(spec: Spec) -> list[Advice]:
    """The advice on a valid spec, in the order of its lines, without what it silences (`advice`)."""
    return wanted(spec, [*usage.advice(spec), *values.advice(spec)])


def wanted(spec: Spec, found: Iterable[Advice]) -> list[Advice]:
    """What the spec does not silence, in the order of its lines; modes may share what was found."""
    return sorted({each for each in found if each.name not in spec.advice})
