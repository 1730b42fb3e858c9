"""The language's records for sensors, their components and gates."""

from __future__ import annotations

from kfgen.spec.schema_filter import ADAPTIVE, ROBUSTNESS
from kfgen.spec.schema_model import INPUT, SENSOR_NOISE
from kfgen.spec.schema_values import (
    CONSTANT,
    DOC,
    KIND,
    UNIT,
    matrix,
    scaling,
    spread,
)
from kfgen.spec.shapes import (
    Choice,
    Either,
    Flag,
    Formula,
    Key,
    Record,
    Table,
    Whole,
)

COMPONENT = Record(
    "component",
    (
        Key(
            "h",
            Formula("h", shaped=True),
            "The expected measurement. Of a vector its parts are the components; of a quaternion, four numbers whose "
            "residual is a rotation.",
            required=True,
        ),
        *spread("R", "measurement noise (of a quaternion: of its rotation error, in rad)"),
        UNIT,
        scaling("component"),
        Key("kind", KIND, "`angle` and `{periodic: P}`: the residual is wrapped.", "real"),
        Key(
            "error",
            Choice(("body", "reference")),
            "The side of a quaternion's residual: log(h^-1 z), or log(z h^-1).",
            "body",
        ),
        Key("residual", Formula("residual", shaped=True), "The residual as an expression in `z` and `h`.", "z - h"),
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
        Key(
            "inputs",
            Table("input", INPUT, declares=True),
            "Known values that come with this measurement (a satellite's position), for h, R, gate and initialize; "
            "fields after the components.",
        ),
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
