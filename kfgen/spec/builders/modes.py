"""The raw data under `imm` -> Imm: every mode complete, what it does not replace taken from the top."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from kfgen.spec.builders.filter import FilterBuilder
from kfgen.spec.builders.model import ModelBuilder
from kfgen.spec.builders.values import Values
from kfgen.spec.problems import SHARED_STATES, short
from kfgen.spec.raw import Fields, entries, matrix
from kfgen.spec.shaping.shaper import Shaper
from kfgen.spec.shaping.vectors import RawRotation
from kfgen.spec.tree import Expression, Number
from kfgen.spec.types import Definition, Imm, Mode, Rotation, Spec, State


class ModesBuilder:
    """Builds the modes of a bank; `top` is what they fall back on."""

    def __init__(
        self, values: Values, model: ModelBuilder, filters: FilterBuilder, top: Fields, shaper: Shaper
    ) -> None:
        self.values, self.model, self.filters, self.shaper = values, model, filters, shaper
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
        raw = self.shaper.model.rotations.get((*f.path, "states"), [])
        self.values.both(f, "P0", f.get("states"), raw)
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
        noise = self.model.noises(f.get("noise"), covered) if "noise" in f else spec.noise
        return Mode(
            name,
            states,
            covariances,
            P0,
            noise,
            self.model.noise_covariance(f, noise)
            if "noise_covariance" in f or "noise" in f
            else spec.noise_covariance,
            self.model.definitions(f.get("let") if "let" in f else self.top.get("let"), self.hidden(name, f)),
            self.model.dynamics(f.get("dynamics")) if "dynamics" in f else spec.dynamics,
            self.model.sensors(f.get("measurements")) if "measurements" in f else spec.measurements,
            self.filters.filter(f.get("filter"), spec.errors) if "filter" in f else spec.filter,
            f.place,
            self.rotations(spec, f, raw),
        )

    def hidden(self, name: str, f: Fields) -> tuple[Definition, ...]:
        """The definitions that no user has written, of what this mode has or inherits."""
        inherited = [(key,) for key in self.top.values if key not in f]
        return self.shaper.hidden([*inherited, *(("imm", "modes", name, key) for key in f.values)])

    def rotations(self, spec: Spec, f: Fields, raw: list[RawRotation]) -> tuple[Rotation, ...]:
        """The top's quaternions with this mode's variances."""
        if "states" not in f:
            bare = tuple(replace(rotation, variances=(None, None, None)) for rotation in spec.rotations)
            return bare if "P0" in f else spec.rotations
        own = {rotation.name: rotation for rotation in self.model.rotations(raw, "P0" in f)}
        return tuple(
            replace(r, variances=own[r.name].variances, place=own[r.name].place) if r.name in own else r
            for r in spec.rotations
        )

    def states(self, spec: Spec, f: Fields) -> tuple[State, ...]:
        """The top's states with this mode's init and variance."""
        if "states" not in f:
            if "P0" in f:
                return tuple(replace(state, variance=None) for state in spec.states)
            return spec.states
        own = dict(entries(f.get("states")))
        whole = {part: group.name for group in spec.groups for part in group.parts}
        found = []
        for state in spec.states:
            fields = own.get(state.name)
            if fields is None:
                written = f.get("states")
                if isinstance(written, Fields) and state.name not in written:
                    self.problems.add(
                        written.place,
                        f"the state {short(whole.get(state.name, state.name))} is missing",
                        SHARED_STATES,
                    )
                found.append(replace(state, variance=self.values.bad(state.place)))
                continue
            rotation = state.kind == "quaternion"
            variance = None if rotation else self.values.variance(fields, "P0" in f)
            found.append(
                replace(state, init=self.values.formula(fields, "init"), variance=variance, place=fields.place)
            )
        return tuple(found)
