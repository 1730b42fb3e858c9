"""What each function of a filter reads: it tests these inputs and parameters for NaN and infinity, and no others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from kfgen.reference.evaluate import renamed
from kfgen.reference.manifold import Manifold
from kfgen.spec.modes import mode_specs
from kfgen.spec.sensors import filter_of
from kfgen.spec.tree import Expression, names
from kfgen.spec.types import Matrix, Noise, Sensor, Spec

Names = frozenset[str]


class Read:
    """What the functions of a filter read. Attribute: predict."""

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.predict = read_by_predict(spec)
        self._update: dict[tuple[str, tuple[int, ...]], Names] = {}

    def update(self, sensor: str, used: tuple[int, ...]) -> Names:
        """Of an update with some of a sensor's components."""
        key = sensor, used
        if key not in self._update:
            self._update[key] = read_by_update(self.spec, sensor, used)
        return self._update[key]


def read_by_predict(spec: Spec) -> Names:
    """Names in f, Q, the covariance of the noise inputs in use, and `reject`; of an imm of any mode, and in the
    transition matrix."""
    if spec.imm is not None:
        transition = _closure(spec, [entry for row in spec.imm.transition for entry in row])
        return transition.union(*map(read_by_predict, mode_specs(spec)))
    dynamics, chosen = spec.dynamics, spec.filter
    formulas: list[Expression] = list(dynamics.f.values())
    formulas += _noise(in_use(spec, spec.noise, formulas), spec.noise_covariance)
    if chosen.gain is not None:  # the gain is a constant
        formulas = list(dynamics.f.values())
    elif chosen.adapt_Q is None:
        formulas += _entries(dynamics.Q)
    if isinstance(chosen.reject, Expression):
        formulas.append(chosen.reject)
    return _closure(spec, formulas)


def adapted_names(spec: Spec) -> Names:
    """Names in the additive Q."""
    return _closure(spec, _entries(spec.dynamics.Q))


def read_by_update(spec: Spec, sensor: str, used: Sequence[int] | None = None) -> Names:
    """Names in h, R and own residuals of the components in use (None: all), in the noise inputs that these h contain,
    in the gate and in psi; of an imm of any mode."""
    if spec.imm is not None:
        return Names().union(*(read_by_update(mode, sensor, used) for mode in mode_specs(spec)))
    (whole,) = [each for each in spec.measurements if each.name == sensor]
    own, chosen = whole if used is None else _part(whole, used), filter_of(spec.filter, whole)
    formulas = [component.h for component in own.components]
    if spec.filter.gain is None:
        formulas += _noise(in_use(spec, own.noise, formulas), own.noise_covariance)
        if chosen.adapt_R is None:
            formulas += _own_noise(own)
    residuals = [renamed(c.residual.tree, _HIDDEN) for c in own.components if c.residual is not None]
    robust = chosen.robust
    psi = [] if robust is None else [e.tree for e in (robust.psi, robust.psi_dot) if e is not None]
    if own.gate is not None and own.gate.threshold is not None:
        formulas.append(own.gate.threshold)
    trees = [*(formula.tree for formula in formulas), *residuals, *psi]
    return _reach(spec, [name for tree in trees for name in names(tree)])


def _part(sensor: Sensor, used: Sequence[int]) -> Sensor:
    """The sensor as if it had only some of its components."""
    space = Manifold([component.name for component in sensor.components], sensor.rotations)
    rows, left = space.rows(used), tuple(b.rotation for b in space.part(used).rotations if b.rotation is not None)
    R = None if sensor.R is None else tuple(tuple(sensor.R[i][j] for j in rows) for i in rows)
    return replace(sensor, components=tuple(sensor.components[i] for i in used), R=R, rotations=left)


_HIDDEN = {"z": "", "h": ""}


def _own_noise(sensor: Sensor) -> list[Expression]:
    """The entries of R."""
    return list(variances(sensor).values()) if sensor.R is None else [entry for row in sensor.R for entry in row]


def variances(sensor: Sensor) -> dict[str, Expression]:
    """Error -> its variance, where the sensor gives one."""
    parts = {part for rotation in sensor.rotations for part in rotation.parts}
    given = {c.name: c.variance for c in sensor.components if c.name not in parts}
    for rotation in sensor.rotations:
        given |= dict(zip(rotation.errors, rotation.variances, strict=True))
    return {name: variance for name, variance in given.items() if variance is not None}


def in_use(spec: Spec, noise: Iterable[Noise], formulas: Iterable[Expression]) -> tuple[Noise, ...]:
    """The noise inputs, without the variances of those that the formulas do not contain: nothing reads these. Points
    that carry all noise inputs (`augment`) do."""
    found = _closure(spec, formulas)
    return tuple(w if spec.filter.augment or w.name in found else replace(w, variance=None) for w in noise)


def _noise(noise: Iterable[Noise], full: Matrix | None) -> list[Expression]:
    """The covariance of noise inputs."""
    if full is not None:
        return [entry for row in full for entry in row]
    return [each.variance for each in noise if each.variance is not None]


def _entries(matrix: Matrix | Mapping[str, Expression]) -> list[Expression]:
    if isinstance(matrix, Mapping):
        return list(matrix.values())
    return [entry for row in matrix for entry in row]


def _closure(spec: Spec, formulas: Iterable[Expression]) -> Names:
    return _reach(spec, [name for formula in formulas for name in names(formula.tree)])


def _reach(spec: Spec, pending: list[str]) -> Names:
    """With what is in the definitions that are used."""
    definitions = {definition.name: definition.value for definition in spec.let}
    found: set[str] = set()
    while pending:
        name = pending.pop()
        if name not in found:
            found.add(name)
            pending += names(definitions[name].tree) if name in definitions else ()
    return frozenset(found)
