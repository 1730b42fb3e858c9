"""Vectors of number-like values (see `numbers`), where what is structurally zero is not computed.

A matrix is a list of rows.
"""

from __future__ import annotations

from kfgen.filters.algebra.numbers import Number, is_one, is_positive, is_zero, reciprocal

Vector = list[Number]
Rows = list[list[Number]]


def plus(a: Number, b: Number) -> Number:
    """a + b, also where one of them is a structural zero of Python's."""
    return b if is_zero(a) else a if is_zero(b) else a + b


def minus(a: Number, b: Number) -> Number:
    """a - b, likewise."""
    return a if is_zero(b) else -b if is_zero(a) else a - b


def times(a: Number, b: Number) -> Number:
    """a b, also where one of them is a structural zero or one of Python's."""
    if is_zero(a) or is_zero(b):
        return 0
    return b if is_one(a) else a if is_one(b) else a * b


def dot(a: Vector, b: Vector) -> Number:
    """Sum of a_i b_i, without the terms that are zero."""
    total: Number = 0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def zeros(rows: int, columns: int) -> Rows:
    return [[0] * columns for _ in range(rows)]


def quotients(c: Vector, s: Number, r: Number) -> Vector:
    """c / s, and 0 where s is 0, for s = r + something not negative."""
    inverse = 1 / s if is_positive(r) else reciprocal(s)[1]
    return [times(x, inverse) for x in c]
