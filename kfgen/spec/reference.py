"""The reference page of the language, written from the tables that validation uses."""

from __future__ import annotations

from kfgen.spec.expressions import MAX_EXPONENT, MAX_LENGTH, MAX_NESTING, MAX_NODES
from kfgen.spec.guide import GUIDE
from kfgen.spec.handbook import HANDBOOK
from kfgen.spec.names import MAX_NAME
from kfgen.spec.reader import MAX_BYTES, MAX_DEPTH
from kfgen.spec.schema import ADVICE, RECORDS
from kfgen.spec.shapes import (
    SCOPE_WORDS,
    Budget,
    Choice,
    Either,
    Flag,
    Formula,
    Items,
    Key,
    Record,
    Reference,
    Shape,
    Table,
    Text,
    Tuple,
    Whole,
)
from kfgen.spec.shaping.expand import MAX_EXPANDED
from kfgen.spec.tree import FUNCTIONS
from kfgen.spec.vector_guide import vectors

_TITLES = {
    "spec": ("The spec", "The top of the file."),
    "parameter": ("parameters.<name>", "A number alone is its value."),
    "dt": ("dt", "As a mapping, dt is an argument of predict. As a number it is compiled in."),
    "state": ("states.<name>", "Exactly one of `std` and `var`, unless `P0` is given."),
    "initialize": ("initialize", ""),
    "input": ("inputs.<name>", "Also `measurements.<name>.inputs.<name>`."),
    "output": ("outputs.<name>", "A vector is told by its parts."),
    "noise": (
        "noise.<name>",
        "Exactly one of `std`, `var`, `density`, `root_density`, unless `noise_covariance` is given.",
    ),
    "dynamics": ("dynamics", ""),
    "sensor": ("measurements.<name>", ""),
    "component": (
        "measurements.<name>.z.<name>",
        "Exactly one of `std` and `var`, unless `R` is given; beside `noise` none.",
    ),
    "sensor noise": (
        "measurements.<name>.noise.<name>",
        "Exactly one of `std` and `var`, unless `noise_covariance` is given.",
    ),
    "gate": ("measurements.<name>.gate", ""),
    "filter": ("filter", "A key that the filter type does not use is an error, even at its default."),
    "sigma_points": ("filter.sigma_points", ""),
    "robust": ("filter.robust", "Either `influence` or `psi`."),
    "adaptive": (
        "filter.adaptive",
        "`true` stands for the default probability. At most one of the two keys.",
    ),
    "fixed": ("fixed", ""),
    "code": ("code", ""),
    "history": (
        "history",
        "`<name>_history.h`: the filter with its past. Ages count predictions; a log has them in `<sensor>.age`.",
    ),
    "imm": ("imm", "The top of the spec is shared; a key of a mode replaces the top-level key whole."),
    "mode": ("imm.modes.<name>", ""),
    "mode state": ("imm.modes.<name>.states.<name>", "Everything else about the state is the top's."),
}  # fmt: skip

_FUNCTION_NOTES = {
    "where": "`where(condition, a, b)`: a where the condition holds, else b; only that one may fail",
    "table": "`table(x, [x1, x2, ...], [y1, y2, ...])`: linear between the points, clamped beyond the ends (there the "
    "slope is that of the inside); the first list increases",
    "sign": "`sign(x)`: -1, 0 or 1",
    "atan2": "`atan2(y, x)`",
    "hypot": "`hypot(x, y)`",
}

# What the language leaves open, and how it is decided here.
DECISIONS = (
    "`filter` may be left out (an ekf with its defaults), and so may `type` (ekf) and `iterations` (3). "
    "`dynamics` and `measurements` are required; `dynamics: {f: {}}` is a model whose states stay as "
    "they are.",
    "Without the key `dt` neither `dt` nor `t` may be used, and the form must be discrete. `nominal` is "
    "required where dt is an argument of predict; `min` must be greater than 0.",
    "A whole number (iterations, substeps, reset_after, a budget) may be a constant expression with a "
    "whole value.",
    "`unit`, `doc` and `description` take a number as it is written (`unit: 1`), but no boolean and no "
    "date.",
    "`P0` and variances of states exclude each other, and so do `P0` and `covariances`, `R` and "
    "variances of components, `noise_covariance` and variances of noises. `noise_covariance` is per "
    "step.",
    "Noise variances may use what Q may use. Definitions may be written in any order, without circles; "
    "a definition may stand where all that it rests on may stand.",
    "In a residual, `z` and `h` are the measurement and its prediction, also where a state has that "
    "name; in psi, `e` is the normalised innovation. `kind` and `residual` of a component exclude each "
    "other.",
    "The noises of sensors share the name space of all names, so two sensors have differently named "
    "noises.",
    "`robust: huber` stands for `{influence: huber, k: 1.345}`. `gain: steady` excludes robust, "
    "adaptive, adapt_R, adapt_Q and partial, which make the gain vary, and limits of variances, which "
    "are not kept; a gate is allowed. It assumes that each prediction is followed by one update of each "
    "sensor, in order; get_covariance gives P after the last of them.",
    "adapt_R and adapt_Q lie strictly between 0 and 1; leave them out to switch them off. adapt_Q is "
    "there for kf, ekf and ekf2. With a run-time dt, Q may be a constant times dt: it is then kept, read "
    "and learnt per second, each correction divided by the last step.",
    "Custom sigma points have one column per state, and so exclude `augment` with noises; wm sums to 1; "
    "`reject` needs a row of zeros among them.",
    "Covariances are checked where they are constant (P0 with parameters at their spec values): "
    "symmetric, and positive semidefinite within a relative rounding error of 1e-9 of the correlations.",
    "An imm has 2 to 8 modes; mu0 defaults to equal probabilities. A mode's `states` lists every state. "
    "A mode's `states` replaces an inherited P0, a mode's `P0` replaces inherited variances and "
    "covariances. kind and partial of a sensor are the same in all modes.",
    "The parts of a matrix M are `M_1_1`, `M_1_2`, ... An index is a whole number. A list has at most 100 entries; a "
    f"part of an expression, written out, at most {MAX_EXPANDED} nodes. A name has one shape in all modes.",
    "In `covariances` two vectors take a matrix, or, of equal size, a number or a vector for equal parts. A residual "
    "of a vector works part by part. `gate`, `rate` and limits of a filter are numbers.",
    "Each sensor stands once in `initialize`, and each state is set by one of them. A quaternion is set whole.",
    "A constant must fit the scalar (float: below 3.4e38). A number is at most 1.7e308 and, if not 0, "
    "at least 1e-308.",
    "Long sums and products (more than 24 operands) are evaluated as balanced trees.",
    f"A file has at most {MAX_BYTES} bytes and is nested at most {MAX_DEPTH} deep. Anchors and aliases "
    "are allowed, as long as what they stand for stays small.",
)  # fmt: skip


def markdown() -> str:
    """The complete reference, as Markdown."""
    parts = [_INTRODUCTION.strip(), _expressions(), _names(), vectors(), _scopes(), "## Keys"]
    seen: list[Record] = []
    for record in RECORDS:
        _sections(record, parts, seen)
    parts += [GUIDE, HANDBOOK]
    parts.append(_advice())
    parts.append("## What is decided where the language leaves a choice")
    parts.append("\n".join(f"* {decision}" for decision in DECISIONS))
    return "\n\n".join(parts) + "\n"


_INTRODUCTION = """
# The kfgen spec language, version 1

A spec is one YAML 1.2 file. Keys are strings and known; an unknown key, a key twice, and a key that the
chosen filter does not use are errors. Booleans are not numbers; dates, merge keys, tags, and non-finite,
underscored, hexadecimal and octal numbers are errors. Every mistake of a file is listed in one run, as
`FILE:LINE:COL: KEY.PATH: what is wrong; what to write instead`.

In `{...}` and `[...]` an expression with a comma must be quoted: `f: {th: "atan2(py, px)"}`.
"""


def _expressions() -> str:
    functions = [name for name in FUNCTIONS if name not in _FUNCTION_NOTES]
    notes = "\n".join(f"* {note}" for note in _FUNCTION_NOTES.values())
    return f"""## Expressions

Wherever a number stands, an expression may stand: decimal numbers, names, `+ - * / **`, unary minus and
parentheses, with the precedence of Python (`-x**2` is `-(x**2)`, `**` groups to the right). Conditions
(`< <= > >=`, `and or not`) stand in `where` and in `reject` only, and are not chained. `pi` and `e` are
constants. Literals are exact decimals; constants fold exactly and are rounded once.

Functions of one or two arguments: {", ".join(f"`{name}`" for name in functions)}. Further:

{notes}

An expression has at most {MAX_LENGTH} characters, {MAX_NODES} nodes and a nesting of {MAX_NESTING}; an
integer exponent is at most {MAX_EXPONENT} in size."""


def _names() -> str:
    return f"""## Names

Constants, parameters, states, inputs, noises and definitions share one name space with `dt` (the step in
s) and `t` (seconds since init). Sensors, their components and inputs, outputs and modes have their own. A name is a C
identifier of at most {MAX_NAME} characters without a leading underscore; it is no keyword of C, C++ or
Python, no function of the language, not `pi`, `e`, `t` or `dt` (what stands in no expression may be called
so: sensors, components, the filter), and no macro of C's headers or of Arduino. `name` is no standard
header. Two identifiers of the emitted code may not be equal in upper case, but for types (`tank_t` beside
the index `TANK_T`)."""


def _advice() -> str:
    rows = "\n".join(f"| `{name}` | {text} |" for name, text in ADVICE.items())
    return f"""## Advice

What is allowed but probably not meant is told by `kfgen build` and `check`, one line each on stderr; the exit status
stays what it is. `--quiet` silences all, `advice: [name, ...]` at the top of a spec what it names.

| name | told where |
| --- | --- |
{rows}"""


def _scopes() -> str:
    rows = "\n".join(f"| {scope} | {words} |" for scope, words in SCOPE_WORDS.items())
    return f"""## What may stand where

The tables below name one of these for each expression:

| expression | may use |
| --- | --- |
{rows}"""


def _sections(record: Record, parts: list[str], seen: list[Record]) -> None:
    if any(record is other for other in seen):
        return
    seen.append(record)
    name = record.name
    if name in ("noise", "state") and not any(key.name in ("density", "unit") for key in record.keys):
        name = f"mode {name}"
    elif name == "noise" and record.key("density") is None:
        name = "sensor noise"
    if name in _TITLES:
        title, note = _TITLES[name]
        parts.append(f"### {title}" + (f"\n\n{note}" if note else ""))
        parts.append("\n".join(["| key | value | meaning |", "| --- | --- | --- |", *map(_row, record.keys)]))
    if record.name not in ("spec", "imm", "mode"):
        for key in record.keys:
            for inner in _inner(key.shape):
                _sections(inner, parts, seen)


def _inner(shape: Shape) -> list[Record]:
    if isinstance(shape, Record):
        return [shape]
    if isinstance(shape, Either):
        return [r for s in (shape.scalar, shape.mapping, shape.sequence) if s is not None for r in _inner(s)]
    return _inner(shape.value) if isinstance(shape, Table) else []


def _row(key: Key) -> str:
    meaning = key.doc
    if key.required:
        meaning += " Required."
    if key.default:
        meaning += f" Default: {key.default}."
    if key.only is not None:
        meaning += f" Only for {key.only.subject} {', '.join(f'`{value}`' for value in key.only.values)}."
    meaning = meaning.replace("|", "\\|")
    return f"| `{key.name}` | {_words(key.shape)} | {meaning} |"


def _words(shape: Shape) -> str:
    """What a value looks like."""
    if isinstance(shape, Text):
        return "text"
    if isinstance(shape, Choice):
        return " \\| ".join(f"`{value}`" for value in shape.values)
    if isinstance(shape, Flag):
        return "`true` \\| `false`"
    if isinstance(shape, Formula) and shape.shaped:
        return f"expression or list ({shape.scope})"
    if isinstance(shape, Formula):
        words = " \\| ".join(f"`{word}`" for word in shape.words)
        kind = "condition" if shape.condition else "expression"
        return (f"{words} \\| " if words else "") + f"{kind} ({shape.scope})"
    if isinstance(shape, Whole):
        return f"whole number, {shape.low} to {shape.high}" if shape.high != shape.low else f"`{shape.low}`"
    if isinstance(shape, Budget):
        return "bytes, or with k: `16k`"
    if isinstance(shape, Reference):
        return shape.words
    if isinstance(shape, Items):
        rows = shape.item.sequence if isinstance(shape.item, Either) else shape.item
        if isinstance(rows, Items) and isinstance(rows.item, Formula):
            return f"matrix, a list of rows ({rows.item.scope})"
        return f"list of {shape.what}"
    if isinstance(shape, Tuple):
        return shape.what
    if isinstance(shape, Table):
        return f"{shape.words}: {_words(shape.value)}"
    if isinstance(shape, Record):
        return "mapping" if shape.bare is None else "number \\| mapping"
    parts = [_words(s) for s in (shape.scalar, shape.mapping, shape.sequence) if s is not None]
    return " \\| ".join(parts)
