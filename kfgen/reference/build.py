"""From a spec to its reference filter."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.reference.algorithm import Algorithm
from kfgen.reference.bank import Bank
from kfgen.reference.ekf import Ekf
from kfgen.reference.ekf2 import Ekf2
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.iekf import Iekf
from kfgen.reference.imm import ReferenceImm
from kfgen.reference.model import Model
from kfgen.reference.steady import Steady
from kfgen.reference.ukf import Ukf
from kfgen.spec.modes import mode_specs
from kfgen.spec.types import Spec

# filter type -> its algorithm
_ALGORITHMS: dict[str, Callable[[Model], Algorithm]] = {"kf": Ekf, "ekf": Ekf, "iekf": Iekf, "ekf2": Ekf2, "ukf": Ukf}


def reference(spec: Spec) -> ReferenceFilter:
    """The numpy filter of a spec, which judges the generated one. Raises SpecError for what only the numbers of
    the model can tell."""
    if spec.imm is not None:
        return ReferenceImm(spec, Bank(spec.imm, [_algorithm(mode) for mode in mode_specs(spec)]))
    return ReferenceFilter(spec, _algorithm(spec))


def _algorithm(spec: Spec) -> Algorithm:
    """The filter of a spec, or of the mode of one, that is no imm."""
    options = spec.filter
    return Steady(Model(spec)) if options.gain == "steady" else _ALGORITHMS[options.type](Model(spec))
