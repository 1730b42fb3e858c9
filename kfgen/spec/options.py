"""What a spec chooses beside its model: the filter, fixed point, the code; with all defaults filled in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from kfgen.errors import NOWHERE, Place
from kfgen.spec.tree import Expression

Matrix = tuple[tuple[Expression, ...], ...]


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
