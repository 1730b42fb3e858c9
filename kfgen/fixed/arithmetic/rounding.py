"""Fractions to integers of a binary point: 2^e is the value of raw 1."""

from __future__ import annotations

from fractions import Fraction
from math import floor

from kfgen.fixed.arithmetic.limits import LIMIT

SMALLEST = -1022


def rounded(value: Fraction, e: int) -> int:
    """value / 2^e to the nearest integer that fits."""
    return max(-LIMIT, min(LIMIT, nearest(value, e)))


def power(e: int) -> Fraction:
    return Fraction(2) ** e


def nearest(value: Fraction, e: int) -> int:
    """value / 2^e to the nearest integer, ties upwards."""
    return floor(value / power(e) + Fraction(1, 2))


def size_of(value: Fraction) -> int:
    """The least k with |value| < 2^k; of 0 that of the smallest float."""
    magnitude = abs(value)
    if magnitude == 0:
        return SMALLEST
    k = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    while magnitude >= power(k):
        k += 1
    while magnitude < power(k - 1):
        k -= 1
    return k
