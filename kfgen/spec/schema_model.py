"""The language's records for states, inputs, noises, dynamics and outputs."""

from __future__ import annotations

from kfgen.spec.schema_values import (
    CONSTANT,
    DOC,
    KIND,
    UNIT,
    VALUE,
    VECTOR,
    matrix,
    pair,
    scaling,
    spread,
)
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
    Tuple,
    Whole,
)

PARAMETER = Record(
    "parameter",
    (
        Key("value", VALUE, "The value after init.", required=True),
        VECTOR,
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

_QUATERNION = Only("kind", ("quaternion",), "real", "a state of kind")

STATE = Record(
    "state",
    (
        Key(
            "init",
            Formula("folded", shaped=True),
            "The initial value; that of a quaternion is normalised.",
            required=True,
        ),
        *spread("folded", "initial value (of a quaternion: of the rotation error, in rad)"),
        VECTOR,
        UNIT,
        scaling("state"),
        Key(
            "kind",
            KIND,
            "`angle` lives in (-pi, pi]; `{periodic: P}` in (-P/2, P/2]; `quaternion` is a rotation from body to "
            "reference, four numbers w, x, y, z with an error of three.",
            "real",
        ),
        Key(
            "error",
            Choice(("body", "reference")),
            "The side of the rotation error d: `body` is q exp(d), `reference` exp(d) q.",
            "body",
            only=_QUATERNION,
        ),
        Key(
            "reset",
            Flag(),
            "After an update P is turned to the new attitude; not with an iekf, in which this is inherent.",
            "true",
            only=_QUATERNION,
        ),
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
    Tuple(
        (Reference("error"), Reference("error"), Formula("folded", shaped=True)), "[state, state, covariance]"
    ),
    "triples [state, state, covariance]",
)

INITIALIZE = Record(
    "initialize",
    (
        Key("from", Reference("sensor"), "The sensor whose first update sets states.", required=True),
        Key(
            "states",
            Table("state", Formula("initialize", shaped=True)),
            "Which states are set, each to an expression in the components of that sensor.",
            required=True,
        ),
        Key(
            "var",
            Table("error", Formula("initialize", shaped=True)),
            "Their variances from then on; those of others stay.",
        ),
    ),
)

INPUT = Record("input", (VECTOR, UNIT, scaling("input"), DOC))

OUTPUT = Record(
    "output",
    (
        Key("value", Formula("output", shaped=True), "What is told, beside its standard deviation.", required=True),
        UNIT,
        DOC,
    ),
)

NOISE = Record(
    "noise",
    (
        *spread("Q", "noise, per step"),
        VECTOR,
        Key("density", Formula("Q", shaped=True), "Power spectral density in unit^2/Hz; continuous form only."),
        Key(
            "root_density",
            Formula("Q", shaped=True),
            "The root of the density, as in data sheets; continuous form only.",
        ),
        UNIT,
        DOC,
    ),
)
SENSOR_NOISE = Record("noise", (*spread("R", "noise"), VECTOR, UNIT, DOC))

_CONTINUOUS = Only("form", ("continuous",), "discrete", "dynamics of form")

DYNAMICS = Record(
    "dynamics",
    (
        Key(
            "form",
            Choice(("discrete", "continuous")),
            "`discrete`: f gives x[k+1], a state not listed stays as it is; `continuous`: f gives dx/dt, "
            "a state not listed has 0. Of a quaternion f gives the new one, or the body's angular rate, a 3-vector.",
            "discrete",
        ),
        Key("f", Table("state", Formula("f", shaped=True)), "The process model, one expression per state."),
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
            Either(
                scalar=Formula("Q", shaped=True),
                mapping=Table("error", Formula("Q", shaped=True)),
                sequence=matrix("Q").sequence,
            ),
            "Additive process noise: variances per step by state (one not listed has 0; of a vector a number, a vector "
            "or a matrix), or the full matrix. Evaluated at the prior state.",
            "0",
        ),
    ),
)
