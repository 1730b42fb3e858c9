"""The language's records for states, inputs, noises, dynamics and sensors."""

from __future__ import annotations

from kfgen.spec.schema_filter import ADAPTIVE, ROBUSTNESS
from kfgen.spec.shapes import (
    Choice,
    Either,
    Flag,
    Formula,
    Items,
    Key,
    Only,
    Record,
    Reference,
    Table,
    Text,
    Tuple,
    Whole,
)

CONSTANT, FOLDED = Formula(), Formula("folded")


def matrix(scope: str) -> Items:
    return Items(Items(Formula(scope), "numbers"), "rows")


def pair(what: str) -> Items:
    return Items(CONSTANT, what, 2)


KIND = Either(
    scalar=Choice(("real", "angle")),
    mapping=Record(
        "kind",
        (
            Key(
                "periodic",
                CONSTANT,
                "The period P, greater than 0: the value lives in (-P/2, P/2].",
                required=True,
            ),
        ),
    ),
)
UNIT = Key("unit", Text(), "The physical unit, for documentation.")
DOC = Key("doc", Text(), "A sentence for the documentation of the emitted code.")


def scaling(of: str) -> Key:
    return Key(
        "range",
        pair("[lowest, highest]"),
        f"The values the {of} is expected to take: for scaling, not enforced.",
    )


def spread(scope: str, of: str) -> tuple[Key, ...]:
    return (
        Key("std", Formula(scope), f"The standard deviation of the {of}; exactly one of `std` and `var`."),
        Key("var", Formula(scope), f"The variance of the {of}; exactly one of `std` and `var`."),
    )


PARAMETER = Record(
    "parameter",
    (
        Key("value", CONSTANT, "The value after init.", required=True),
        UNIT,
        scaling("parameter"),
        DOC,
    ),
    bare="value",
)

STEP = Record(
    "dt",
    (
        Key(
            "nominal",
            CONSTANT,
            "The step in s that budgets and scaling assume; greater than 0.",
            required=True,
        ),
        Key("min", CONSTANT, "A smaller step is clamped to this one, and flagged; greater than 0."),
        Key("max", CONSTANT, "A larger step is clamped to this one, and flagged."),
    ),
)

STATE = Record(
    "state",
    (
        Key("init", FOLDED, "The initial value.", required=True),
        *spread("folded", "initial value"),
        UNIT,
        scaling("state"),
        Key("kind", KIND, "`angle` lives in (-pi, pi]; `{periodic: P}` in (-P/2, P/2].", "real"),
        Key(
            "bounds",
            pair("[lowest, highest]"),
            "The state (and sigma points) are clipped to it after each step.",
        ),
        DOC,
    ),
)
MODE_STATE = Record("state", STATE.keys[:3])

COVARIANCES = Items(
    Tuple((Reference("state"), Reference("state"), FOLDED), "[state, state, covariance]"),
    "triples [state, state, covariance]",
)

INITIALIZE = Record(
    "initialize",
    (
        Key("from", Reference("sensor"), "The sensor whose first update sets states.", required=True),
        Key(
            "states",
            Table("state", Reference("component")),
            "Which states are set, each from which component of that sensor.",
            required=True,
        ),
    ),
)

INPUT = Record("input", (UNIT, scaling("input"), DOC))

NOISE = Record(
    "noise",
    (
        *spread("Q", "noise, per step"),
        Key("density", Formula("Q"), "Power spectral density in unit^2/Hz; continuous form only."),
        Key("root_density", Formula("Q"), "The root of the density, as in data sheets; continuous form only."),
        UNIT,
        DOC,
    ),
)
SENSOR_NOISE = Record("noise", (*spread("R", "noise"), UNIT, DOC))

_CONTINUOUS = Only("form", ("continuous",), "discrete", "dynamics of form")

DYNAMICS = Record(
    "dynamics",
    (
        Key(
            "form",
            Choice(("discrete", "continuous")),
            "`discrete`: f gives x[k+1], a state not listed stays as it is; `continuous`: f gives dx/dt, "
            "a state not listed has 0.",
            "discrete",
        ),
        Key("f", Table("state", Formula("f")), "The process model, one expression per state."),
        Key(
            "integrator",
            Choice(("euler", "midpoint", "rk4", "exact")),
            "How dx/dt is integrated over a step; `exact` for linear f only.",
            "rk4",
            only=_CONTINUOUS,
        ),
        Key("substeps", Whole(1, 1000), "Integration steps per step.", "1", only=_CONTINUOUS),
        Key(
            "Q",
            Either(mapping=Table("state", Formula("Q")), sequence=matrix("Q")),
            "Additive process noise: variances per step by state (one not listed has 0), or the full matrix. "
            "Evaluated at the prior state.",
            "0",
        ),
    ),
)

COMPONENT = Record(
    "component",
    (
        Key("h", Formula("h"), "The expected measurement.", required=True),
        *spread("R", "measurement noise"),
        UNIT,
        scaling("component"),
        Key("kind", KIND, "`angle` and `{periodic: P}`: the residual is wrapped.", "real"),
        Key("residual", Formula("residual"), "The residual as an expression in `z` and `h`.", "z - h"),
        DOC,
    ),
)

GATE = Record(
    "gate",
    (
        Key(
            "probability",
            CONSTANT,
            "The vector is rejected when its normalised innovation squared exceeds the chi-square quantile "
            "of this probability, between 0 and 1; exactly one of `probability` and `threshold`.",
        ),
        Key(
            "threshold",
            Formula("gate"),
            "What the normalised innovation squared may not exceed, whichever components are used; greater than 0.",
        ),
        Key(
            "reset_after",
            Whole(1, 1_000_000),
            "After N rejections in a row the next vector is accepted (ANOMALY).",
        ),
    ),
)

SENSOR = Record(
    "sensor",
    (
        Key("z", Table("component", COMPONENT, declares=True), "The components, in order.", required=True),
        Key("R", matrix("R"), "The full noise covariance instead of the components' std or var."),
        Key(
            "noise",
            Table("noise", SENSOR_NOISE, declares=True),
            "Noise inputs that may stand in h (non-additive); their std and var may then be left out.",
        ),
        Key(
            "noise_covariance",
            matrix("R"),
            "The full covariance of these noise inputs, instead of std or var.",
        ),
        Key("gate", GATE, "Rejection of outliers."),
        Key("rate", CONSTANT, "Updates a prediction, greater than 0: what budgets roll first is called least.", "1"),
        Key("robust", ROBUSTNESS, "In place of the filter's; `none`: off.", "the filter's"),
        Key(
            "adaptive",
            Either(scalar=Flag(off="none"), mapping=ADAPTIVE),
            "In place of the filter's; `none`: off.",
            "the filter's",
        ),
        Key("adapt_R", Formula(words=("none",)), "In place of the filter's; `none`: off.", "the filter's"),
        Key("partial", Flag(), "Also emit update_<sensor>_masked, for some of the components.", "false"),
        DOC,
    ),
)
