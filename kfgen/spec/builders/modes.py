"""The raw data under `imm` -> Imm: every mode complete, what it does not replace taken from the top."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from kfgen.spec.builders.filter import FilterBuilder
from kfgen.spec.builders.model import ModelBuilder
from kfgen.spec.builders.values import Values
from kfgen.spec.problems import SHARED_STATES, short
from kfgen.spec.raw import Fields, entries, matrix
from kfgen.spec.tree import Expression, Number
from kfgen.spec.types import Imm, Mode, Spec, State


class ModesBuilder:
    """Builds the modes of a bank; `top` is what they fall back on."""

    def __init__(self, values: Values, model: ModelBuilder, filters: FilterBuilder, top: Fields) -> None:
        self.values, self.model, self.filters = values, model, filters
        self.problems = values.problems
        self.top = top

    def with_modes(self, spec: Spec, f: Fields) -> Spec:
        modes = tuple(self.mode(spec, name, m) for name, m in entries(f.get("modes")))
        count = max(len(modes), 1)
        uniform = Expression(Number(Fraction(1, count)), f"1/{count}", f.place)
        floor = Expression(Number(Fraction("1e-9")), "1e-9", f.place)
        mu0 = f.get("mu0", (uniform,) * count)
        imm = Imm(modes, matrix(f.get("transition")) or (), mu0, f.get("mu_floor", floor), f.place)
        # the interface is the same for all modes, whoever gives it
        sensors = spec.measurements or (modes[0].measurements if modes else ())
        return replace(spec, imm=imm, measurements=sensors)

    def mode(self, spec: Spec, name: str, f: Fields) -> Mode:
        """A mode's key replaces the top-level key whole."""
        states = self.states(spec, f)
        self.values.both(f, "P0", f.get("states"))
        self.values.both(f, "noise_covariance", f.get("noise"))
        own_covariance = "P0" in f or "covariances" in f or "states" in f
        if "P0" in f and "covariances" in f:
            self.problems.add(f.at("covariances"), "`P0` is given too", "write the covariances into P0")
        P0 = matrix(f.get("P0")) if own_covariance else spec.P0
        covariances = self.model.covariances(f) if "covariances" in f else () if own_covariance else spec.covariances
        if "states" in f and "covariances" not in f and "P0" not in f:
            covariances = spec.covariances
        covered = "noise_covariance" in f or ("noise" not in f and "noise_covariance" in self.top)
        for key in ("dynamics", "measurements"):
            if key not in f and key not in self.top:
                self.problems.add(
                    f.place, f"the mode {short(name)} has no `{key}`", f"write `{key}` in it or at the top"
                )
        return Mode(
            name,
            states,
            covariances,
            P0,
            self.model.noises(f.get("noise"), covered) if "noise" in f else spec.noise,
            matrix(f.get("noise_covariance"))
            if "noise_covariance" in f
            else (None if "noise" in f else spec.noise_covariance),
            self.model.definitions(f.get("let")) if "let" in f else spec.let,
            self.model.dynamics(f.get("dynamics")) if "dynamics" in f else spec.dynamics,
            self.model.sensors(f.get("measurements")) if "measurements" in f else spec.measurements,
            self.filters.filter(f.get("filter"), spec.states) if "filter" in f else spec.filter,
            f.place,
        )

    def states(self, spec: Spec, f: Fields) -> tuple[State, ...]:
        """The top's states with this mode's init and variance."""
        if "states" not in f:
            if "P0" in f:
                return tuple(replace(state, variance=None) for state in spec.states)
            return spec.states
        own = dict(entries(f.get("states")))
        found = []
        for state in spec.states:
            fields = own.get(state.name)
            if fields is None:
                written = f.get("states")
                if isinstance(written, Fields) and state.name not in written:
                    self.problems.add(
                        written.place,
                        f"the state {short(state.name)} is missing",
                        SHARED_STATES,
                    )
                found.append(replace(state, variance=self.values.bad(state.place)))
                continue
            variance = self.values.variance(fields, "P0" in f)
            found.append(
                replace(state, init=self.values.formula(fields, "init"), variance=variance, place=fields.place)
            )
        return tuple(found)
