"""A spec after reading and validation: frozen data, in the order of the file, every formula parsed.

Nothing here computes. A standard deviation is stored as a variance (`pow(std, 2)` in the tree); what the
spec leaves out has its documented default. Expressions keep the names of constants: whoever evaluates one
substitutes `Spec.constants` exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from kfgen.errors import NOWHERE, Place
from kfgen.scalar_names import FLOAT
from kfgen.spec.options import Adaptive as Adaptive
from kfgen.spec.options import Code as Code
from kfgen.spec.options import Filter as Filter
from kfgen.spec.options import Fixed as Fixed
from kfgen.spec.options import Matrix as Matrix
from kfgen.spec.options import Robust as Robust
from kfgen.spec.options import SigmaPoints as SigmaPoints
from kfgen.spec.tree import Expression

Range = tuple[Expression, Expression]  # constant expressions


@dataclass(frozen=True)
class Constant:
    name: str
    value: Expression


@dataclass(frozen=True)
class Definition:
    """A `let`: a named subexpression."""

    name: str
    value: Expression


@dataclass(frozen=True)
class Parameter:
    name: str
    value: Expression
    unit: str = ""
    range: Range | None = None
    doc: str = ""


@dataclass(frozen=True)
class Step:
    """The time step. Fixed: `nominal` alone, `run_time` False. Run-time: clamped to [minimum, maximum] where given."""

    nominal: Expression
    run_time: bool = False
    minimum: Expression | None = None
    maximum: Expression | None = None


@dataclass(frozen=True)
class State:
    name: str
    init: Expression
    variance: Expression | None  # None where P0 is given
    unit: str = ""
    range: Range | None = None
    kind: str = "real"  # real | angle | periodic | quaternion (a part of one: Spec.rotations)
    period: Expression | None = None  # angle: 2*pi; periodic: as written; real: None
    bounds: Range | None = None
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class Input:
    name: str
    unit: str = ""
    range: Range | None = None
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class Noise:
    """A noise input. `variance` is per step, or, where `density` is true, a power spectral density (unit^2/Hz)."""

    name: str
    variance: Expression | None  # None where the full covariance of the noises is given
    density: bool = False
    unit: str = ""
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class Group:
    """A vector: consecutive scalars of one table (states, inputs, noises, ...) under one name of the spec."""

    name: str
    parts: tuple[str, ...]
    place: Place = NOWHERE


@dataclass(frozen=True)
class Rotation:
    """A unit quaternion among the states (Hamilton, scalar first) or the components of a sensor, and its error.

    parts: its four numbers w, x, y, z, which are states (components) of kind "quaternion"; errors: the three parts of
    its rotation error, in rad. error: body (q [+] d = q exp(d)) or reference (exp(d) q). variances of the errors: None
    where P0 or R is given whole.
    """

    name: str
    parts: tuple[str, str, str, str]
    errors: tuple[str, str, str]
    error: str = "body"  # body | reference
    reset: bool = True
    variances: tuple[Expression | None, Expression | None, Expression | None] = (None, None, None)
    place: Place = NOWHERE


@dataclass(frozen=True)
class Output:
    """What firmware reads: a value and its standard deviation."""

    name: str
    value: Expression
    unit: str = ""
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class Covariance:
    first: str
    second: str
    value: Expression


@dataclass(frozen=True)
class Initialize:
    """The first update of a sensor sets states (parts of vectors, by name) and, where given, variances of errors.

    The expressions are in the names of the sensor's components, which hide others, its inputs, inputs, constants and
    parameters.
    """

    sensor: str
    states: Mapping[str, Expression]
    variance: Mapping[str, Expression] = field(default_factory=dict)
    let: tuple[Definition, ...] = ()  # what the expressions share, each using only those before it
    place: Place = NOWHERE
    waits: bool = False  # one of a list: predictions and all else wait until every named sensor has come


@dataclass(frozen=True)
class Dynamics:
    form: str = "discrete"  # discrete | continuous
    f: Mapping[str, Expression] = field(default_factory=dict)
    integrator: str = "rk4"  # euler | midpoint | rk4 | exact
    substeps: int = 1
    Q: Mapping[str, Expression] | Matrix = field(default_factory=dict)  # diagonal by state, or the full matrix
    place: Place = NOWHERE


@dataclass(frozen=True)
class Component:
    name: str
    h: Expression
    variance: Expression | None = None  # None where R is given, or (0) where left out beside `noise`
    unit: str = ""
    range: Range | None = None
    kind: str = "real"  # real | angle | periodic
    period: Expression | None = None
    residual: Expression | None = None  # in the names z, h (and all that h may use)
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class Gate:
    """Exactly one of the first two is given."""

    probability: Expression | None
    threshold: Expression | None = None
    reset_after: int | None = None


@dataclass(frozen=True)
class Sensor:
    name: str
    components: tuple[Component, ...]
    R: Matrix | None = None
    noise: tuple[Noise, ...] = ()
    noise_covariance: Matrix | None = None
    gate: Gate | None = None
    partial: bool = False
    rate: Expression | None = None  # calls a prediction; None: 1
    own: Mapping[str, Any] = field(default_factory=dict)  # robust, adaptive, adapt_R where they are not the filter's
    inputs: tuple[Input, ...] = ()  # known values that come with this measurement
    groups: tuple[Group, ...] = ()  # its vectors: components and inputs
    rotations: tuple[Rotation, ...] = ()  # components that are quaternions
    doc: str = ""
    place: Place = NOWHERE

    @property
    def fields(self) -> tuple[Component | Input, ...]:
        """All numbers of a measurement, in the order of the sensor's struct: its components, then its inputs."""
        return (*self.components, *self.inputs)

    @property
    def errors(self) -> tuple[str, ...]:
        """The coordinates of the innovation, in order: R is of this size."""
        return error_names((component.name for component in self.components), self.rotations)


@dataclass(frozen=True)
class History:
    """Measurements may arrive up to `steps` predictions late, `per_step` of one step; each `keep`-th state is kept."""

    steps: int
    per_step: int = 4
    keep: int = 1
    place: Place = NOWHERE
    places: Mapping[str, Place] = field(default_factory=dict)  # of the keys that were written


@dataclass(frozen=True)
class Mode:
    """One mode of an imm; every field is complete (top-level keys that the mode does not replace are filled in)."""

    name: str
    states: tuple[State, ...]
    covariances: tuple[Covariance, ...]
    P0: Matrix | None
    noise: tuple[Noise, ...]
    noise_covariance: Matrix | None
    let: tuple[Definition, ...]
    dynamics: Dynamics
    measurements: tuple[Sensor, ...]
    filter: Filter
    place: Place = NOWHERE
    rotations: tuple[Rotation, ...] = ()  # the spec's, with this mode's variances


@dataclass(frozen=True)
class Imm:
    modes: tuple[Mode, ...]
    transition: Matrix
    mu0: tuple[Expression, ...]
    mu_floor: Expression
    place: Place = NOWHERE


@dataclass(frozen=True)
class Spec:
    name: str
    file: str  # as given by the caller; used in messages only, never in output
    sha256: str  # of the bytes of the file
    description: str = ""
    scalar: str = FLOAT  # float | double | q<m>.<n>
    constants: tuple[Constant, ...] = ()  # in an order in which each uses only those before it
    parameters: tuple[Parameter, ...] = ()
    dt: Step | None = None
    states: tuple[State, ...] = ()
    covariances: tuple[Covariance, ...] = ()
    P0: Matrix | None = None
    initialize: tuple[Initialize, ...] = ()
    inputs: tuple[Input, ...] = ()
    noise: tuple[Noise, ...] = ()
    noise_covariance: Matrix | None = None
    let: tuple[Definition, ...] = ()  # in an order in which each uses only those before it
    dynamics: Dynamics = Dynamics()
    measurements: tuple[Sensor, ...] = ()
    filter: Filter = field(default_factory=Filter)
    fixed: Fixed = field(default_factory=Fixed)
    code: Code = field(default_factory=Code)
    imm: Imm | None = None
    history: History | None = None
    groups: tuple[Group, ...] = ()  # vectors and matrices (by rows) of constants, parameters, states, inputs, noises
    rotations: tuple[Rotation, ...] = ()  # states that are quaternions, in order
    outputs: tuple[Output, ...] = ()
    advice: tuple[str, ...] = ()  # names of the advice that is not wanted
    place: Place = NOWHERE
    places: Mapping[str, Place] = field(default_factory=dict)  # of the top-level keys that were written

    @property
    def errors(self) -> tuple[str, ...]:
        """The coordinates of the error, in order (NE): a number's own name, three of a rotation for its four parts."""
        return error_names((state.name for state in self.states), self.rotations)


def error_names(names: Iterable[str], rotations: tuple[Rotation, ...]) -> tuple[str, ...]:
    """The coordinates of the error of states or components: a quaternion's three in the place of its four parts."""
    first = {rotation.parts[0]: rotation.errors for rotation in rotations}
    others = {part for rotation in rotations for part in rotation.parts[1:]}
    return tuple(e for name in names if name not in others for e in first.get(name, (name,)))
