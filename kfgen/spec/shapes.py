"""The vocabulary in which `schema.py` describes the language: shapes of values, keys, scopes of names."""

from __future__ import annotations

from dataclasses import dataclass

# What the names in an expression may stand for, by where the expression stands. The words are the kinds
# of a scope's table of names; `dt` is any step, `fixed dt` only one that is compiled in.
SCOPES: dict[str, frozenset[str]] = {
    "constant": frozenset({"constant"}),
    "compiled": frozenset({"constant", "fixed dt"}),
    "folded": frozenset({"constant", "fixed dt", "parameter"}),
    "f": frozenset({"constant", "parameter", "state", "input", "noise", "definition", "dt", "t"}),
    "Q": frozenset({"constant", "parameter", "state", "input", "definition", "dt", "t"}),
    "h": frozenset(
        {"constant", "parameter", "state", "input", "sensor input", "sensor noise", "definition", "fixed dt", "t"}
    ),
    "R": frozenset({"constant", "parameter", "state", "input", "sensor input", "definition", "fixed dt", "t"}),
    "residual": frozenset(
        {"constant", "parameter", "state", "input", "sensor input", "definition", "fixed dt", "t", "z", "h"}
    ),
    "psi": frozenset({"constant", "parameter", "fixed dt", "innovation"}),
    "transition": frozenset({"constant", "parameter", "dt"}),
    "gate": frozenset({"constant", "parameter", "input", "sensor input", "fixed dt"}),
    "initialize": frozenset({"component", "sensor input", "input", "constant", "parameter", "fixed dt"}),
    "output": frozenset({"constant", "parameter", "state", "definition", "fixed dt", "t"}),
}

# The same in words, for messages and the reference.
SCOPE_WORDS: dict[str, str] = {
    "constant": "constants",
    "compiled": "constants and a fixed dt",
    "folded": "constants, a fixed dt and parameters (their spec values)",
    "f": "constants, parameters, states, inputs, noises, definitions, dt and t",
    "Q": "constants, parameters, states, inputs, definitions, dt and t",
    "h": "constants, parameters, states, inputs, the sensor's own inputs and noises, definitions, t and a fixed dt",
    "R": "constants, parameters, states, inputs, the sensor's own inputs, definitions, t and a fixed dt",
    "residual": "z, h, constants, parameters, states, inputs, the sensor's own inputs, definitions, t and a fixed dt",
    "psi": "e (the normalised innovation), constants, parameters and a fixed dt",
    "transition": "constants, parameters and dt",
    "gate": "constants, parameters, inputs, the sensor's own inputs and a fixed dt",
    "initialize": "the sensor's components (which hide other names) and inputs, inputs, constants, parameters and a "
    "fixed dt",
    "output": "constants, parameters, states, definitions of these, t and a fixed dt",
}


@dataclass(frozen=True)
class Text:
    """Any text; a number is taken as it is written."""


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    values: tuple[str, ...]


@dataclass(frozen=True)
class Flag:
    """true or false; `off` is another word for false."""

    off: str = ""


@dataclass(frozen=True)
class Formula:
    """A number or an expression. `words` may stand instead of it; `condition` wants a comparison.

    shaped: it may be a vector or a matrix, written as an expression or as a list.
    """

    scope: str = "constant"
    condition: bool = False
    words: tuple[str, ...] = ()
    shaped: bool = False


@dataclass(frozen=True)
class Whole:
    """A whole number (or a constant expression with such a value)."""

    low: int
    high: int | None = None


@dataclass(frozen=True)
class Budget:
    """A number of bytes, with an optional suffix k (1024)."""


@dataclass(frozen=True)
class Reference:
    """The name of something declared elsewhere."""

    of: str  # state | sensor | component


@dataclass(frozen=True)
class Items:
    """A list. `what` says of what, in words."""

    item: Shape
    what: str
    length: int | None = None


@dataclass(frozen=True)
class Tuple:
    """A list of fixed length whose entries have shapes of their own."""

    items: tuple[Shape, ...]
    what: str


@dataclass(frozen=True)
class Table:
    """A mapping whose keys are names: declared here (`declares`) or elsewhere (`of`)."""

    of: str
    value: Shape
    declares: bool = False


@dataclass(frozen=True)
class Record:
    """A mapping with known keys. A scalar in its place stands for the key `bare` alone."""

    name: str
    keys: tuple[Key, ...]
    bare: str | None = None

    def key(self, name: str) -> Key | None:
        return next((key for key in self.keys if key.name == name), None)


@dataclass(frozen=True)
class Either:
    """One shape where a scalar stands, others where a mapping or a list stands."""

    scalar: Shape | None = None
    mapping: Shape | None = None
    sequence: Shape | None = None


@dataclass(frozen=True)
class Only:
    """A key is used only where another key of the same record has one of some values."""

    key: str
    values: tuple[str, ...]
    default: str  # of that other key
    subject: str  # what it is in words: "filter type"
    why: tuple[tuple[str, str], ...] = ()  # value -> the reason, where there is more to say

    def reason(self, value: str) -> str:
        return dict(self.why).get(value, "")


@dataclass(frozen=True)
class Key:
    """A key of the language: its shape, what it means, its default in words, and where it is used."""

    name: str
    shape: Shape
    doc: str
    default: str = ""
    required: bool = False
    only: Only | None = None


Shape = Text | Choice | Flag | Formula | Whole | Budget | Reference | Items | Tuple | Table | Record | Either
