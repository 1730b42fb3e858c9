"""The modes of an imm as specs of their own."""

from __future__ import annotations

from dataclasses import replace

from kfgen.spec.types import Spec


def mode_specs(spec: Spec) -> list[Spec]:
    """One spec per mode; of a spec without imm the spec itself."""
    if spec.imm is None:
        return [spec]
    return [
        replace(
            spec,
            imm=None,
            initialize=(),
            states=mode.states,
            rotations=mode.rotations,
            covariances=mode.covariances,
            P0=mode.P0,
            noise=mode.noise,
            noise_covariance=mode.noise_covariance,
            let=mode.let,
            dynamics=mode.dynamics,
            measurements=mode.measurements,
            filter=mode.filter,
            place=mode.place,
            places={},
        )
        for mode in spec.imm.modes
    ]
