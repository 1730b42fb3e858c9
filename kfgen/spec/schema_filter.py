"""The language, defined once, as data: filters, fixed-point and code options."""

from __future__ import annotations

from kfgen.spec.shapes import (
    Budget,
    Choice,
    Either,
    Flag,
    Formula,
    Items,
    Key,
    Only,
    Record,
    Reference,
    Shape,
    Table,
    Text,
    Whole,
)

TYPES = ("kf", "ekf", "iekf", "ekf2", "ukf")
_CONSTANT, _COMPILED = Formula(), Formula("compiled")


def _types(*types: str, **why: str) -> Only:
    return Only("type", types, "ekf", "filter type", tuple(why.items()))


def _points(*kinds: str) -> Only:
    return Only("kind", kinds, "merwe", "sigma points of kind")


_PER_SCALAR = _types(
    "kf",
    "ekf",
    "ekf2",
    "ukf",
    iekf="it is defined per scalar measurement, which would change the iterations' minimum",
)
_ROWS = Items(Items(_CONSTANT, "numbers"), "rows")

SIGMA_POINTS = Record(
    "sigma_points",
    (
        Key(
            "kind",
            Choice(("merwe", "julier", "wiki", "trivial", "cubature", "custom")),
            "The rule for points and weights.",
            "merwe",
        ),
        Key(
            "alpha",
            _CONSTANT,
            "The spread of the points, greater than 0.",
            "1",
            only=_points("merwe", "wiki"),
        ),
        Key("beta", _CONSTANT, "2 is right for a Gaussian.", "2", only=_points("merwe", "wiki")),
        Key(
            "kappa",
            _CONSTANT,
            "The secondary scaling; it must leave gamma positive.",
            "0 (wiki: the number of dimensions)",
            only=_points("merwe", "julier", "wiki"),
        ),
        Key("redraw", Flag(), "Draw new points from the predicted state before an update.", "true"),
        Key(
            "points",
            _ROWS,
            "One row per point, one column per state, in units of the root.",
            only=_points("custom"),
        ),
        Key(
            "wm",
            Items(_CONSTANT, "weights"),
            "The weights of the mean; they sum to 1.",
            only=_points("custom"),
        ),
        Key("wc", Items(_CONSTANT, "weights"), "The weights of the covariance.", only=_points("custom")),
    ),
)

ROBUST = Record(
    "robust",
    (
        Key("influence", Choice(("chernodarov", "huber")), "The influence function; or give `psi`."),
        Key("k", _CONSTANT, "Where huber begins to clip, greater than 0; `influence: huber` only.", "1.345"),
        Key("psi", Formula("psi"), "An influence function in the normalised innovation `e`."),
        Key("psi_dot", Formula("psi"), "Its derivative, clamped to >= 0.", "derived from psi"),
    ),
)

ROBUSTNESS = Either(scalar=Choice(("none", "chernodarov", "huber")), mapping=ROBUST)

ADAPTIVE = Record(
    "adaptive",
    (
        Key("probability", _CONSTANT, "Of the chi-square test, between 0 and 1.", "0.999; with robust 0.997"),
        Key("chi2", _CONSTANT, "The threshold itself, instead of a probability; greater than 0."),
    ),
)

_BY_STATE: Shape = Either(scalar=_COMPILED, mapping=Table("state", _COMPILED))

FILTER = Record(
    "filter",
    (
        Key(
            "type",
            Choice(TYPES),
            "`kf` (f and h must be linear), `ekf`, `iekf` (iterated), `ekf2` (second order), `ukf`.",
            "ekf",
        ),
        Key(
            "covariance",
            Choice(("ud", "full", "sqrt")),
            "How P is kept: U D U^T, the full matrix, or its square root.",
            "ud",
        ),
        Key(
            "update",
            Choice(("bierman", "joseph", "standard")),
            "The form of the covariance update: with ud `bierman` or `joseph`, with full `joseph` or "
            "`standard`; not with sqrt.",
            "bierman (ud), joseph (full)",
            only=_types("kf", "ekf", "iekf", "ekf2", ukf="a sigma-point update has only one form"),
        ),
        Key(
            "iterations",
            Whole(1, 20),
            "Linearisations in all, the first at the prior; 1 to 20 (1 is the ekf).",
            "3",
            only=_types("iekf"),
        ),
        Key(
            "gain",
            Choice(("steady",)),
            "The steady-state gain from the Riccati equation, compiled in; for constant F, H, Q and R.",
            only=_types("kf"),
        ),
        Key(
            "sequential",
            Flag(),
            "With ud: component by component instead of the whole vector at once. Cheap; it leaves out the "
            "covariance of the linearisation error.",
            "false",
            only=_types("ukf"),
        ),
        Key(
            "sigma_points",
            SIGMA_POINTS,
            "How the sigma points are chosen.",
            "merwe 1, 2, 0",
            only=_types("ukf"),
        ),
        Key(
            "augment",
            Flag(),
            "Carry all noise inputs as sigma-point dimensions, even where they enter linearly.",
            "false",
            only=_types("ukf"),
        ),
        Key(
            "reject",
            Formula("Q", condition=True, words=("non_finite",)),
            "A propagated point for which this condition holds (or that is not finite) is replaced by the "
            "propagated mean point; `non_finite` replaces only those.",
            only=_types("ukf"),
        ),
        Key(
            "robust",
            ROBUSTNESS,
            "Reduces the weight of large innovations; with a ukf only `ud` and `sequential`.",
            "none",
            only=_PER_SCALAR,
        ),
        Key(
            "adaptive",
            Either(scalar=Flag(), mapping=ADAPTIVE),
            "Chi-square-tested H-infinity correction of the covariance.",
            "false",
            only=_PER_SCALAR,
        ),
        Key(
            "adapt_R",
            _CONSTANT,
            "Forgetting factor of the innovation-based adjustment of R, between 0 and 1; R may use constants and "
            "parameters, at their spec values.",
            "off",
            only=_PER_SCALAR,
        ),
        Key(
            "adapt_Q",
            _CONSTANT,
            "The same for the additive Q, which must be constant.",
            "off",
            only=_types(
                "kf",
                "ekf",
                "ekf2",
                ukf="it needs the scalar gains of an ekf",
                iekf="it needs the scalar gains of an ekf",
            ),
        ),
        Key(
            "variance_floor",
            _BY_STATE,
            "Smallest variance P_ii, one for all states or by state, in every form: P_ii is raised (REGULARIZED).",
            "off",
        ),
        Key(
            "variance_ceiling",
            _BY_STATE,
            "Largest variance P_ii, likewise, after the floors: row and column i of P are scaled down.",
            "off",
        ),
        Key("innovation_floor", _COMPILED, "Smallest innovation variance (REGULARIZED).", "off"),
        Key(
            "gain_limit",
            _COMPILED,
            "|K_ij| is limited to this; joseph only.",
            "off",
            only=_types("kf", "ekf", "iekf", "ekf2", ukf="it needs the joseph form"),
        ),
        Key(
            "consider",
            Items(Reference("state"), "states"),
            "States whose gain is held at zero but whose uncertainty counts (Schmidt); joseph only.",
            only=_types("kf", "ekf", "iekf", "ekf2", ukf="it needs the joseph form"),
        ),
    ),
)

FIXED = Record(
    "fixed",
    (
        Key(
            "scale",
            Either(scalar=Choice(("auto",)), mapping=Table("state", _CONSTANT)),
            "A power-of-two unit per state; `auto` derives units and binary points.",
            "auto",
        ),
        Key("rounding", Choice(("nearest", "floor")), "How products are rounded.", "nearest"),
        Key("overflow", Choice(("saturate",)), "Values saturate, with the flag SATURATED.", "saturate"),
        Key(
            "log",
            Text(),
            "A log, by its path from the spec's folder, whose ranges count beside those of simulated runs, whatever is "
            "done with the filter.",
        ),
    ),
)

_UNROLL = Choice(("auto", "full", "none"))

CODE = Record(
    "code",
    (
        Key(
            "unroll",
            Either(scalar=_UNROLL, mapping=Table("function", _UNROLL)),
            "`none`: loops over static arrays; `auto`: loops where straight-line code would exceed `flash`, of what is "
            "called least first (`rate` of a sensor); or by function: `{predict: full, update_gnss: none}`. In fixed "
            "point all are one: an element of a covariance has a binary point of its own, which a loop could not have.",
            "auto",
        ),
        Key(
            "flash",
            Budget(),
            "Bytes of flash (k = 1024) of init, predict and the updates without library functions, predicted for a "
            "Cortex-M4F: more is a build error.",
        ),
        Key("ram", Budget(), "Bytes of RAM of one filter, likewise."),
        Key("stack", Budget(), "Bytes of stack, likewise."),
        Key("log_likelihood", Flag(), "Keep the log-likelihood of the last update.", "false"),
        Key("gate_count", Flag(), "Keep the number of rejections in a row, per sensor.", "false"),
        Key(
            "compensated",
            Either(scalar=Flag(), sequence=Items(Reference("state"), "states")),
            "Carry on in a second word, `x_rest`, what rounding leaves of all states, or of those listed: for states "
            "that are large beside their steps, such as a position on the earth in float. With kf, ekf, iekf, ekf2.",
            "false",
        ),
    ),
)
