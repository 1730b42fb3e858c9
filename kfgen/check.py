"""The generated C, compiled for the host, held against the numpy reference on a random but plausible track.

The track is simulated from the spec's own model: each sensor at its own rate, with gaps, and with missing
components where a sensor is `partial`. Both filters are given the same numbers, rounded to what the scalar
type can carry, so that what differs is the filters' own arithmetic.

* The error of x is in standard deviations of the reference, less the resolution of the numbers themselves (8
  units in the last place of the largest |x_i| for floating point, 4 least significant bits for fixed point).
* Where the model amplifies rounding (an unstable state, a track that has been lost), a second reference, whose x is
  rounded to the scalar type after every call (or moved by its last digit), departs as well: eight times its departure
  is allowed, if that is more. Once that departs by more than the tolerance, nothing is left to compare: such a row is
  counted, and all go on from the first reference.
* The error of P_ij is relative to sqrt(P_ii P_jj), in fixed point less one LSB of P at the interface.
* Rows whose truth is outside of its declared range tell nothing of a fixed-point filter: they are counted too.
* Where eight roundings of a float of x's size exceed a tenth of its standard deviation in most rows, what is compared
  tells nothing of that state any more: the check fails, and says which.
* A decision at a threshold (a gate, a robust weight) may fall differently by round-off. Such a difference is
  counted, and the compiled filter then goes on from the reference's estimate; more than 1 % of the calls, or
  any error bit that only one of the two returns, fails the check.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from kfgen.advice.grain import Grain
from kfgen.excursions import rows_outside
from kfgen.geometry import part_of
from kfgen.interface import Array, Filter
from kfgen.native.run import Plan, plan
from kfgen.scalar_names import DOUBLE, FLOAT, is_fixed
from kfgen.simulate import simulate
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status, describe

if TYPE_CHECKING:
    from kfgen.generate import Generated
    from kfgen.native.filter import NativeFilter
    from kfgen.reference import ReferenceFilter

STEPS = 400
SEED = 1
GAPS = 0.05
DIFFERENT_DECISIONS = 0.01
TOLERANCES = {FLOAT: 2e-3, DOUBLE: 1e-6}
FIXED_TOLERANCE = 2e-2


def tolerance_of(scalar: str) -> float:
    """The largest error of x (in sigma) and P (relative) that passes."""
    return TOLERANCES.get(scalar, FIXED_TOLERANCE)


@dataclass
class Worst:
    """The largest error so far and where it was."""

    error: float = 0.0
    where: str = ""

    def see(self, errors: Array, names: list[str], row: int) -> None:
        """Take in errors [k] of the quantities `names`; NaN is the largest of all."""
        errors = np.where(np.isnan(errors), np.inf, errors)
        i = int(np.argmax(errors))
        if errors[i] > self.error:
            self.error, self.where = float(errors[i]), f"{names[i]}, step {row + 1}"


@dataclass(frozen=True)
class Outcome:
    """The result of a check; `differences` holds the calls whose status differs, as text."""

    name: str
    scalar: str
    steps: int
    calls: int
    x: Worst
    P: Worst
    differences: tuple[str, ...]
    errors_differ: bool
    tolerance: float
    resolution: float  # what rounding x alone does to the reference, in sigma
    lost: int  # rows that could not be compared for it
    certificate: tuple[str, ...] = ()  # fixed point: operations proved to fit, guarded, at risk
    coarse: tuple[str, ...] = ()  # states that a float of their size resolves too coarsely
    outside: int = 0  # fixed point: rows that are outside of what the spec declares, and are not compared

    @property
    def passed(self) -> bool:
        few = len(self.differences) <= DIFFERENT_DECISIONS * self.calls
        close = self.x.error <= max(self.tolerance, 8 * self.resolution) and self.P.error <= self.tolerance
        return close and few and not self.errors_differ and not self.coarse and self.outside < self.steps


def check(spec: Spec, steps: int = STEPS, seed: int = SEED, generated: Generated | None = None) -> Outcome:
    """Compile `spec`, or what was generated of it, and compare it with the reference.

    KfgenError without a compiler; SpecError.
    """
    from kfgen.generate import build
    from kfgen.native import load_filters
    from kfgen.reference import reference

    generated = build(spec) if generated is None else generated
    kf = load_filters([generated])[0]
    outcome = compare(kf, reference(spec), steps, seed, reference(spec))
    if generated.fixed is None:
        return outcome
    return replace(outcome, certificate=generated.fixed.certified())


def compare(
    kf: NativeFilter,
    ref: ReferenceFilter,
    steps: int = STEPS,
    seed: int = SEED,
    coarse: ReferenceFilter | None = None,
) -> Outcome:
    """Run the filters side by side over a simulated track of `steps` rows; `coarse` is a second reference."""
    spec = kf.spec
    every = {sensor.name: 1 + i for i, sensor in enumerate(spec.measurements)}
    log = simulate(spec, steps, seed, every, GAPS)
    work = _rounded(kf, plan(spec, log))
    outside = rows_outside(spec, log.columns) & is_fixed(spec.scalar)
    random = np.random.default_rng(seed)
    x, P, rounding = Worst(), Worst(), Worst()
    kf.init()
    ref.init()
    coarse = ref if coarse is None else coarse
    coarse.init()
    scales = _Scales(kf, ref)
    differences: list[str] = []
    calls, lost, errors_differ = 0, 0, False
    tolerance = tolerance_of(spec.scalar)
    grain = Grain(list(spec.errors), spec.code.compensated) if spec.scalar == FLOAT else None
    for row in range(steps):
        for call in _calls(spec, work, row, random):
            ours, theirs = _made(kf, call), _made(ref, call)
            if coarse is not ref:
                _made(coarse, call)
                coarse.displace(scales.rounded)
            calls += 1
            if (ours ^ theirs) & ~Status.REGULARIZED:  # where a pivot is zero depends on the factorisation
                _follow(ref, kf, coarse)
                if outside[row]:
                    continue
                text = f"{call.sensor or 'predict'} of step {row + 1}: {describe(ours)}, reference {describe(theirs)}"
                differences.append(text)
                errors_differ |= ours >= ERROR or theirs >= ERROR
        if outside[row]:
            _follow(ref, kf, coarse)
            continue
        if grain is not None:
            grain.see(ref.model.space.flat(ref.x), ref.P)
        departs = scales.x_errors(coarse.x, ref.x, ref.P)
        if coarse is not ref and not max(*departs, *scales.P_errors(coarse.P, ref.P)) <= tolerance:
            lost += 1
            _follow(ref, kf, coarse)
            continue
        x.see(scales.x_errors(kf.x, ref.x, ref.P), scales.names, row)
        rounding.see(departs, scales.names, row)
        P.see(scales.P_errors(kf.P, ref.P), scales.pairs, row)
    return Outcome(
        kf.name, spec.scalar, steps, calls, x, P, tuple(differences), errors_differ, tolerance,
        rounding.error, lost, coarse=grain.coarse() if grain is not None else (), outside=int(outside.sum()),
    )  # fmt: skip


def _follow(ref: ReferenceFilter, *others: Filter) -> None:
    """Give other filters the estimate of the reference. All modes of a bank go on from the combined one, those of the
    reference too; mu is the reference's."""
    x = ref.x
    P = ref.P if ref.spec.filter.gain is None else None
    for each in (ref, *others) if ref.spec.imm is not None else others:
        each.set_state(x)
        if P is not None:
            each.set_covariance(P)
        if ref.spec.imm is not None:
            each.mu = ref.mu


@dataclass(frozen=True)
class Call:
    """An update of a sensor with z [m] and its own inputs, or without a sensor a predict; u [nu], dt in s and mask
    where they are used."""

    sensor: str | None = None
    z: Array = field(default_factory=lambda: np.empty(0))
    u: Array | None = None
    dt: float | None = None
    mask: int | None = None
    inputs: Array | None = None


def _made(kf: Filter, call: Call) -> int:
    if call.sensor is None:
        return kf.predict(call.u, call.dt)
    return kf.update(call.sensor, call.z, call.u, call.mask, call.inputs)


def _calls(spec: Spec, work: Plan, row: int, random: np.random.Generator) -> list[Call]:
    """The calls of one row in order."""
    u = work.u[row] if spec.inputs else None
    run_time = spec.dt is not None and spec.dt.run_time
    calls: list[Call] = []
    if work.step[row]:
        calls.append(Call(u=u, dt=float(work.dt[row]) if run_time else None))
    for i, (sensor, place) in enumerate(readings_of(spec)):
        if work.mask[row, i]:
            m = len(sensor.components)
            masked = sensor.partial and random.random() < 0.2
            mask = int(random.integers(0, 1 << m)) if masked else None
            z, own = np.split(work.z[row, place], [m])
            calls.append(Call(sensor.name, z, u, mask=mask, inputs=own if sensor.inputs else None))
    return calls


def _rounded(kf: NativeFilter, work: Plan) -> Plan:
    """The same numbers as the scalar type carries them."""
    scalar, units = kf.struct.value, kf.struct.units
    return replace(
        work,
        dt=scalar.to_physical(scalar.to_raw(work.dt, units.dt), units.dt),
        u=scalar.to_physical(scalar.to_raw(work.u, units.u), units.u),
        z=scalar.to_physical(scalar.to_raw(work.z, units.readings), units.readings),
    )


class _Scales:
    """What errors are measured by; it learns magnitudes along the track."""

    def __init__(self, kf: NativeFilter, ref: ReferenceFilter) -> None:
        self._space = ref.model.space
        self.names = list(self._space.errors)
        n = len(self.names)
        self._upper = np.triu_indices(n)
        self.pairs = [f"{self.names[i]}, {self.names[j]}" for i, j in zip(*self._upper, strict=True)]
        self._periods = ref.model.turns
        dtype = kf.struct.value.dtype
        floating = dtype.kind == "f"
        self._dtype = dtype if floating else np.dtype(np.float64)
        self._lsb = None if floating else kf.struct.units.x
        self._P_lsb = 0.0 if floating else kf.struct.units.P
        self._relative = 8 * float(np.finfo(dtype).eps) if floating else 0.0
        self._absolute = np.zeros(n) if floating else 4 * kf.struct.units.errors
        self._magnitude = self._space.size(ref.x)
        self._variance = np.diag(ref.P).copy()

    def rounded(self, x: Array) -> Array:
        """x [n] as the scalar type carries it; where that is x itself, with its last digit moved."""
        if self._lsb is not None:
            nearest: Array = np.floor(x / self._lsb + 0.5) * self._lsb
            return nearest
        rounded: Array = x.astype(self._dtype).astype(np.float64)
        return np.nextafter(rounded, np.inf) if self._dtype == np.float64 else rounded

    def x_errors(self, x: Array, truth: Array, P: Array) -> Array:
        """Errors [n] in sigma; of a state that is known exactly, relative to its magnitude."""
        self._magnitude = np.maximum(self._magnitude, self._space.size(truth))
        error = self._space.difference(x, truth)
        for i, period in self._periods.items():
            error[i] = part_of(period).local(float(error[i]), 0.0)
        beyond = np.maximum(np.abs(error) - self._absolute - self._relative * self._magnitude, 0.0)
        sigma = np.sqrt(np.maximum(np.diag(P), 0.0))
        scale = np.where(sigma > 0, sigma, np.where(self._magnitude > 0, self._magnitude, 1.0))
        errors: Array = beyond / scale
        return errors

    def P_errors(self, P: Array, truth: Array) -> Array:
        """Errors of the upper triangle [n(n+1)/2], relative to the standard deviations."""
        variance = np.diag(truth)
        self._variance = np.maximum(self._variance, variance)
        # a variance that has come down to round-off of what it was is as good as zero
        floor = np.maximum(variance, np.maximum(self._relative, 1e-12) * self._variance)
        scale = np.sqrt(np.outer(floor, floor))
        beyond = np.maximum(np.abs(P - truth) - self._P_lsb, 0.0)
        errors: Array = (beyond / np.where(scale > 0, scale, 1.0))[self._upper]
        return errors
