"""The language, defined once, as data: the top of a spec, and its modes.

Validation, error messages and the reference page all derive from these tables; the model and its sensors are in
`schema_model.py`, filters in `schema_filter.py`.
"""

from __future__ import annotations

from kfgen.scalar_names import DOUBLE, FLOAT, RULE
from kfgen.spec.schema_filter import CODE, FILTER, FIXED
from kfgen.spec.schema_model import (
    COVARIANCES,
    DYNAMICS,
    INITIALIZE,
    INPUT,
    MODE_STATE,
    NOISE,
    OUTPUT,
    PARAMETER,
    SENSOR_NOISE,
    STATE,
    STEP,
)
from kfgen.spec.schema_sensor import COMPONENT, GATE, SENSOR
from kfgen.spec.schema_values import CONSTANT, VALUE, matrix
from kfgen.spec.shapes import Choice, Either, Formula, Items, Key, Record, Table, Text, Whole

ADVICE = {
    "unused": "nothing uses a constant, parameter, input or definition",
    "unused_noise": "a noise input stands in no f, one of a sensor in no h",
    "no_process_noise": "nothing acts on any state, so that P falls for ever",
    "unobservable": "no sensor sees a state, or tells some apart: the model, linearised along a simulated track",
    "init_range": "init lies outside the range, a parameter's value outside its own",
    "degrees": "an angle, or what stands in a sine, is in degrees",
    "std_variance": "a `std` looks like a variance (`sigma**2`, `var_x`), or a `var` like a deviation",
    "precision": "P0 exceeds R by more than a float resolves, with `covariance: full`",
    "robust_start": "P0 is so large against R that a robust update takes the first measurement for a glitch",
    "far_origin": "8 roundings of a float of a state's size exceed a tenth of its sigma, or take its motion",
    "sigma_angle": "sigma points lie more than half a turn from the mean of an angle that f or h bends",
    "alpha": "alpha makes weights that the scalar cannot carry",
    "ud_cost": "a prediction with `covariance: full` takes a third of the operations",
    "per_step": "a sensor's `rate` may bring more measurements in a step than `history` keeps of one",
    "loops": "more than 32 kB of straight-line code, of which loops take a tenth",
}
"""The names of all advice, and where it is given."""

LET = Table("definition", Formula("f", shaped=True), declares=True)
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

HISTORY = Record(
    "history",
    (
        Key(
            "steps",
            Whole(1, 10_000),
            "How many predictions late a measurement may be; one that is older is refused (TOO_OLD).",
            required=True,
        ),
        Key("per_step", Whole(1, 255), "Measurements that are kept of one step; the next is TOO_OLD.", "4"),
        Key(
            "keep",
            Whole(1, 10_000),
            "Each so many-th state is kept: less RAM, and up to keep - 1 predictions more to repeat.",
            "1",
        ),
    ),
)

TOP = Record(
    "spec",
    (
        Key("kfgen", Whole(1, 1), "The version of the language: 1.", required=True),
        Key("name", Text(), "The prefix of all that is emitted; a C identifier.", required=True),
        Key("description", Text(), "Goes into the header comment."),
        Key("scalar", Text(), f"`{FLOAT}`, `{DOUBLE}` or `q<m>.<n>` with {RULE}.", FLOAT),
        Key(
            "constants",
            Table("constant", VALUE, declares=True),
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
        Key(
            "initialize",
            Either(mapping=INITIALIZE, sequence=Items(INITIALIZE, "mappings {from: ..., states: ...}")),
            "States set by the first update of a sensor; P stays, or `var`. A list: of several sensors, and all else "
            "waits until each has come.",
        ),
        Key(
            "inputs",
            Table("input", INPUT, declares=True),
            "Known inputs u, an argument of predict, in order.",
        ),
        *PER_MODE[2:],
        Key("dynamics", DYNAMICS, "The process model."),
        Key("measurements", MEASUREMENTS, "The sensors, each with its own update function."),
        Key(
            "outputs",
            Table("output", OUTPUT, declares=True),
            "What firmware reads: values and their standard deviations, computed when they are asked for.",
        ),
        Key("filter", FILTER, "What filter is built.", "an ekf with its defaults"),
        Key("fixed", FIXED, "Fixed-point choices; used with a q scalar only, allowed with any."),
        Key("code", CODE, "What the emitted code looks like, and what it may cost."),
        Key("advice", Items(Choice(tuple(ADVICE)), "names of advice"), "What `kfgen build` is not to advise."),
        Key(
            "history",
            HISTORY,
            "Also emit <name>_history.h and .c, which take late measurements, of any sensor, at their time: the result "
            "is bit for bit that of the same calls in order.",
        ),
        Key("imm", IMM, "An interacting-multiple-model filter: several modes over the same states."),
    ),
)

RECORDS: tuple[Record, ...] = (
    TOP, PARAMETER, STEP, STATE, INITIALIZE, INPUT, NOISE, OUTPUT, DYNAMICS, SENSOR, COMPONENT, SENSOR_NOISE, GATE,
    FILTER, FIXED, CODE, HISTORY, IMM, MODE,
)  # fmt: skip

__all__ = ["IMM", "MODE", "RECORDS", "SENSOR", "STATE", "TOP"]
