"""How many steps of an integrator integers can be made for: each operation of each has a binary point of its own."""

from __future__ import annotations

from kfgen.errors import SpecError
from kfgen.spec.modes import mode_specs
from kfgen.spec.parts import nodes
from kfgen.spec.types import Spec

LARGEST = 6000  # operations of a step that are tried in some ten thousand rows, in Python
STAGES = {"euler": 1, "midpoint": 2, "rk4": 4}


def limit_substeps(spec: Spec) -> None:
    """SpecError where a step of an integrator is written out too often."""
    for each in mode_specs(spec):
        dynamics = each.dynamics
        if dynamics.form != "continuous" or dynamics.substeps == 1:
            continue
        n = len(each.states)
        one = STAGES.get(dynamics.integrator, 1) * (nodes((dynamics.f, each.let)) + n * n)
        most = max(1, LARGEST // one)
        if dynamics.substeps > most:
            raise SpecError.at(
                dynamics.place,
                f"{dynamics.substeps} substeps are about {one * dynamics.substeps} operations, each of which has a "
                f"binary point of its own in {spec.scalar}: up to {LARGEST} can be tried",
                f"use at most {most} substeps, or float",
            )
