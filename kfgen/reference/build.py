"""From a spec to its reference filter."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.errors import SpecError
from kfgen.reference.algorithm import Algorithm
from kfgen.reference.ekf import Ekf
from kfgen.reference.ekf2 import Ekf2
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.iekf import Iekf
from kfgen.reference.model import Model
from kfgen.reference.steady import Steady
from kfgen.reference.ukf import Ukf
from kfgen.spec.types import Spec

# filter type -> its algorithm
_ALGORITHMS: dict[str, Callable[[Model], Algorithm]] = {"kf": Ekf, "ekf": Ekf, "iekf": Iekf, "ekf2": Ekf2, "ukf": Ukf}


def reference(spec: Spec) -> ReferenceFilter:
    """The numpy filter of a spec, which judges the generated one. Raises SpecError for what is not built yet."""
    options = spec.filter
    if spec.imm is not None:
        raise SpecError.at(spec.imm.place, "the reference filter for imm is not built yet")
    algorithm = Steady if options.gain == "steady" else _ALGORITHMS[options.type]
    return ReferenceFilter(spec, algorithm(Model(spec)))
