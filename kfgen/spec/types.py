"""A spec after reading and validation: frozen data, in the order of the file, every formula parsed.

Nothing here computes. A standard deviation is stored as a variance (`pow(std, 2)` in the tree); what the
spec leaves out has its documented default. Expressions keep the names of constants: whoever evaluates one
substitutes `Spec.constants` exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kfgen.errors import NOWHERE, Place
from kfgen.scalar_names import FLOAT
from kfgen.spec.tree import Expression

Matrix = tuple[tuple[Expression, ...], ...]
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
    kind: str = "real"  # real | angle | periodic
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
class Covariance:
    first: str
    second: str
    value: Expression


@dataclass(frozen=True)
class Initialize:
    sensor: str
    states: Mapping[str, str]  # state -> component of the sensor


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
    doc: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class SigmaPoints:
    kind: str = "merwe"  # merwe | julier | wiki | trivial | cubature | custom
    alpha: Expression | None = None
    beta: Expression | None = None
    kappa: Expression | None = None
    redraw: bool = True
    points: Matrix | None = None
    wm: tuple[Expression, ...] | None = None
    wc: tuple[Expression, ...] | None = None


@dataclass(frozen=True)
class Robust:
    influence: str  # chernodarov | huber | custom
    k: Expression | None = None
    psi: Expression | None = None
    psi_dot: Expression | None = None


@dataclass(frozen=True)
class Adaptive:
    """Exactly one of the two is given where the spec gives one; both None: the documented default."""

    probability: Expression | None = None
    chi2: Expression | None = None


@dataclass(frozen=True)
class Filter:
    type: str = "ekf"  # kf | ekf | iekf | ekf2 | ukf
    covariance: str = "ud"  # ud | full | sqrt
    update: str | None = None  # bierman | joseph | standard; the default is filled in; None for ukf and sqrt
    iterations: int | None = None
    gain: str | None = None  # steady
    sequential: bool = False
    sigma_points: SigmaPoints | None = None
    augment: bool = False
    reject: Expression | str | None = None  # an expression, or "non_finite"
    robust: Robust | None = None
    adaptive: Adaptive | None = None
    adapt_R: Expression | None = None
    adapt_Q: Expression | None = None
    variance_floor: Mapping[str, Expression] = field(default_factory=dict)  # a single number is spread over the states
    variance_ceiling: Mapping[str, Expression] = field(default_factory=dict)
    innovation_floor: Expression | None = None
    gain_limit: Expression | None = None
    consider: tuple[str, ...] = ()
    place: Place = NOWHERE
    places: Mapping[str, Place] = field(default_factory=dict)  # of the keys that were written


@dataclass(frozen=True)
class Fixed:
    scale: Mapping[str, Expression] | None = None  # None: auto
    rounding: str = "nearest"
    overflow: str = "saturate"
    log: str | None = None  # a path, relative to the spec
    log_place: Place = NOWHERE


@dataclass(frozen=True)
class Code:
    unroll: str = "auto"
    unroll_by: Mapping[str, str] = field(default_factory=dict)  # function -> full | none | auto, in place of `unroll`
    flash: int | None = None
    ram: int | None = None
    stack: int | None = None
    log_likelihood: bool = False
    gate_count: bool = False
    compensated: tuple[str, ...] = ()  # states
    places: Mapping[str, Place] = field(default_factory=dict)


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
    initialize: Initialize | None = None
    inputs: tuple[Input, ...] = ()
    noise: tuple[Noise, ...] = ()
    noise_covariance: Matrix | None = None
    let: tuple[Definition, ...] = ()  # in an order in which each uses only those before it
    dynamics: Dynamics = Dynamics()
    measurements: tuple[Sensor, ...] = ()
    filter: Filter = Filter()
    fixed: Fixed = Fixed()
    code: Code = Code()
    imm: Imm | None = None
    history: History | None = None
    advice: tuple[str, ...] = ()  # names of the advice that is not wanted
    place: Place = NOWHERE
    places: Mapping[str, Place] = field(default_factory=dict)  # of the top-level keys that were written
