"""The modes of an imm as specs of their own."""

from __future__ import annotations

from dataclasses import replace

from kfgen.errors import Mistake, SpecError
from kfgen.spec.types import Spec


def mode_specs(spec: Spec) -> list[Spec]:
    """One spec per mode. Raises SpecError where a mode's filter does not go into a bank.

    A steady-state gain belongs to a covariance that no mixing changes: after a switch, when the spread between
    the modes ought to raise it, such a mode would trust its mixed state as if nothing had happened.
    """
    assert spec.imm is not None
    steady = [mode.filter for mode in spec.imm.modes if mode.filter.gain == "steady"]
    if steady:
        text = "`gain: steady` does not go with imm: mixing the modes changes their covariances"
        places = dict.fromkeys(options.places.get("gain", options.place) for options in steady)
        raise SpecError(Mistake(place, text, "remove `gain`") for place in places)
    return [
        replace(
            spec,
            imm=None,
            initialize=None,
            states=mode.states,
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
