"""The language, defined once, as data: the top of a spec, its model and its sensors.

Validation, error messages and the reference page all derive from these tables; filters are in
`schema_filter.py`.
"""

from __future__ import annotations

from kfgen.spec.schema_filter import CODE, FILTER, FIXED
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
    Shape,
    Table,
    Text,
    Tuple,
    Whole,
)

CONSTANT, COMPILED, FOLDED = Formula(), Formula("compiled"), Formula("folded")


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
            "of this probability, between 0 and 1.",
            required=True,
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
        Key("partial", Flag(), "Also emit update_<sensor>_masked, for some of the components.", "false"),
        DOC,
    ),
)

LET = Table("definition", Formula("f"), declares=True)
MEASUREMENTS = Table("sensor", SENSOR, declares=True)
NOISES = Table("noise", NOISE, declares=True)
PER_MODE: tuple[Key, ...] = (
    Key("covariances", COVARIANCES, "Initial covariances beside the variances of the states."),
    Key("P0", matrix("folded"), "The full initial covariance, instead of std, var and covariances."),
    Key("noise", NOISES, "Noise inputs, which may stand anywhere in `dynamics.f` (also non-additively)."),
    Key("noise_covariance", matrix("Q"), "The full covariance of the noise inputs, instead of std or var."),
    Key("let", LET, "Named subexpressions, for dynamics, Q and measurements."),
)

MODE = Record(
    "mode",
    (
        Key(
            "states",
            Table("state", MODE_STATE),
            "init and std or var of every state, where they differ from the top's.",
        ),
        *PER_MODE,
        Key("dynamics", DYNAMICS, "The process model of this mode."),
        Key("measurements", MEASUREMENTS, "The same sensors and components as the top's, with other models."),
        Key("filter", FILTER, "The filter of this mode; modes may mix types."),
    ),
)

IMM = Record(
    "imm",
    (
        Key("modes", Table("mode", MODE, declares=True), "The modes, 2 to 8.", required=True),
        Key(
            "transition",
            matrix("transition"),
            "Row i: the probabilities of going from mode i to each mode; rows sum to 1, and are normalised where they "
            "depend on dt or parameters.",
            required=True,
        ),
        Key("mu0", Items(CONSTANT, "mode probabilities"), "The initial mode probabilities.", "all equal"),
        Key("mu_floor", CONSTANT, "The smallest mode probability; keeps a mode alive.", "1e-9"),
    ),
)

TOP = Record(
    "spec",
    (
        Key("kfgen", Whole(1, 1), "The version of the language: 1.", required=True),
        Key("name", Text(), "The prefix of all that is emitted; a C identifier.", required=True),
        Key("description", Text(), "Goes into the header comment."),
        Key("scalar", Text(), "`float`, `double` or `q<m>.<n>` with m + n = 32 and 8 <= n <= 24.", "float"),
        Key(
            "constants",
            Table("constant", CONSTANT, declares=True),
            "Compile-time values; each may use constants above it.",
        ),
        Key(
            "parameters",
            Table("parameter", PARAMETER, declares=True),
            "Run-time values: fields of the filter, changeable while it runs.",
        ),
        Key(
            "dt",
            Either(scalar=CONSTANT, mapping=STEP),
            "The step in s: a number (compiled in), or a mapping (then an argument of predict).",
        ),
        Key("states", Table("state", STATE, declares=True), "The states, in the order of x.", required=True),
        *PER_MODE[:2],
        Key("initialize", INITIALIZE, "States set by the first update of a sensor; P stays."),
        Key(
            "inputs",
            Table("input", INPUT, declares=True),
            "Known inputs u, an argument of predict, in order.",
        ),
        *PER_MODE[2:],
        Key("dynamics", DYNAMICS, "The process model."),
        Key("measurements", MEASUREMENTS, "The sensors, each with its own update function."),
        Key("filter", FILTER, "What filter is built.", "an ekf with its defaults"),
        Key("fixed", FIXED, "Fixed-point choices; used with a q scalar only, allowed with any."),
        Key("code", CODE, "What the emitted code looks like, and what it may cost."),
        Key("imm", IMM, "An interacting-multiple-model filter: several modes over the same states."),
    ),
)

RECORDS: tuple[Record, ...] = (
    TOP, PARAMETER, STEP, STATE, INITIALIZE, INPUT, NOISE, DYNAMICS, SENSOR, COMPONENT, SENSOR_NOISE, GATE,
    FILTER, FIXED, CODE, IMM, MODE,
)  # fmt: skip

__all__ = ["IMM", "MODE", "RECORDS", "SENSOR", "STATE", "TOP", "Shape"]
