"""What messages say of keys and shapes: which key was meant, and what is wanted in a place, in words."""

from __future__ import annotations

from kfgen.spec.problems import did_you_mean, suggestion
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


def meant_key(word: str, known: list[str]) -> str:
    """The key that an unknown one was probably meant for; empty without a guess."""
    return _SYNONYMS.get(word) or suggestion(word, known) or ""


def unknown_key_hint(word: str, known: list[str]) -> str:
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
