"""The language's keys that many records share: units, variances, shapes, ranges."""

from __future__ import annotations

from kfgen.spec.shapes import (
    Choice,
    Either,
    Formula,
    Items,
    Key,
    Record,
    Text,
    Whole,
)

CONSTANT, FOLDED = Formula(), Formula("folded")
VALUE = Formula(shaped=True)


def matrix(scope: str) -> Either:
    """Rows of numbers; or an expression, of the whole or of a row."""
    row = Either(scalar=Formula(scope, shaped=True), sequence=Items(Formula(scope), "numbers"))
    return Either(scalar=Formula(scope, shaped=True), sequence=Items(row, "rows"))


def pair(what: str) -> Items:
    return Items(VALUE, what, 2)


VECTOR = Key(
    "vector",
    Either(scalar=Whole(1, 100), sequence=Items(Text(), "names of parts")),
    "A vector of so many parts (2: x, y; 3: x, y, z; others: 1, 2, ...), or of parts with these names. In other keys "
    "one number stands for all parts.",
)

KIND = Either(
    scalar=Choice(("real", "angle", "quaternion")),
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
        Key("std", Formula(scope, shaped=True), f"The standard deviation of the {of}; exactly one of `std` and `var`."),
        Key(
            "var",
            Formula(scope, shaped=True),
            f"The variance of the {of}; exactly one of `std` and `var`. Of a vector also a full covariance.",
        ),
    )
