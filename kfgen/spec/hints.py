"""What messages say of keys and shapes: which key was meant, and what is wanted in a place, in words."""

from __future__ import annotations

from kfgen.spec.problems import did_you_mean, short, suggestion
from kfgen.spec.shapes import (
    Budget,
    Choice,
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

# what other tools call a key
_SYNONYMS = {
    "sigma": "std", "variance": "var", "initial": "init", "x0": "init", "process": "dynamics",
    "model": "dynamics", "params": "parameters", "sensors": "measurements", "method": "integrator",
}  # fmt: skip

# what may be written for a kind: whole turns make no difference
_WRAPPED = {"angle", "angular", "is_angle", "circular", "cyclic", "wrap", "wraps", "wrapped", "wrap_angle"}
_PERIODIC = {"period", "periodic", "modulo", "modulus"}


def meant_key(word: str, known: list[str]) -> str:
    """The key that an unknown one was probably meant for; empty without a guess."""
    return "kind" if _is_kind(word, known) else _SYNONYMS.get(word) or suggestion(word, known) or ""


def _is_kind(word: str, known: list[str]) -> bool:
    """Whether a key of a state or of a component says that it is an angle."""
    return "kind" in known and ("init" in known or "h" in known) and word.lower() in _WRAPPED | _PERIODIC


def unknown_key_hint(word: str, known: list[str], value: str = "") -> str:
    """value: what is written for the key, where it is not a collection."""
    if _is_kind(word, known):
        told = value.lower() not in ("", "true", "yes", "on", "1", "angle", "false", "no", "off", "0")
        angle = word.lower() in _WRAPPED and not told
        return "write `kind: angle`" if angle else f"write `kind: {{periodic: {short(value)[1:-1] if told else 'P'}}}`"
    synonym = _SYNONYMS.get(word)
    return f"did you mean `{synonym}`?" if synonym in known else did_you_mean(word, known, "keys here")


def missing_key_hint(key: Key) -> str:
    example = "1" if key.name == "kfgen" else "..."
    return f"write `{key.name}: {example}` ({key.doc[0].lower() + key.doc[1:].rstrip('.')})"


def wanted_words(shape: Shape) -> str:
    """What a shape is, in words."""
    if isinstance(shape, Text):
        return "text"
    if isinstance(shape, Flag):
        return "true or false"
    if isinstance(shape, Choice):
        return "one of " + ", ".join(shape.values)
    if isinstance(shape, Formula | Whole):
        return "a number or an expression"
    if isinstance(shape, Budget):
        return "a number of bytes"
    if isinstance(shape, Reference):
        return f"the name of a {shape.words}"
    if isinstance(shape, Items):
        return f"a list of {shape.what}"
    if isinstance(shape, Tuple):
        return shape.what
    if isinstance(shape, Record):
        return "a mapping"
    if isinstance(shape, Table):
        return f"a mapping ({shape.words}: value)"
    return " or ".join(wanted_words(s) for s in (shape.scalar, shape.mapping, shape.sequence) if s)
