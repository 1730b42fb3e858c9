"""From a spec to its reference filter."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.errors import Mistake, SpecError
from kfgen.reference.algorithm import Algorithm
from kfgen.reference.ekf import Ekf
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.model import Model
from kfgen.spec.types import Spec

# filter type -> its algorithm
_ALGORITHMS: dict[str, Callable[[Model], Algorithm]] = {"kf": Ekf, "ekf": Ekf}

# options of a filter that none of the algorithms knows so far
_UNKNOWN = (
    "gain", "sequential", "sigma_points", "augment", "reject", "robust", "adaptive", "adapt_R", "adapt_Q",
    "innovation_floor", "gain_limit", "consider",
)  # fmt: skip


def reference(spec: Spec) -> ReferenceFilter:
    """The numpy filter of a spec, which judges the generated one.

    Raises SpecError, naming every filter type and option of the spec that is not built yet.
    """
    options = spec.filter
    if spec.imm is not None:
        raise SpecError.at(spec.imm.place, "the reference filter for imm is not built yet")
    mistakes = []
    if options.type not in _ALGORITHMS:
        place = options.places.get("type", options.place)
        mistakes.append(Mistake(place, f"the reference filter for {options.type} is not built yet"))
    if options.covariance == "sqrt":
        place = options.places.get("covariance", options.place)
        mistakes.append(Mistake(place, "the reference filter for covariance: sqrt is not built yet"))
    for key in _UNKNOWN:
        if getattr(options, key):
            place = options.places.get(key, options.place)
            mistakes.append(Mistake(place, f"the reference filter for {key} is not built yet"))
    if mistakes:
        raise SpecError(mistakes)
    return ReferenceFilter(spec, _ALGORITHMS[options.type](Model(spec)))
