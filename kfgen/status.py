"""The status word every function of a filter returns: the same bits in the emitted C and in Python."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """A bit mask. Below ERROR are warnings; an error is exactly one bit, and no warning stands beside it."""

    OK = 0
    REGULARIZED = 0x01  # a variance was held at its floor or ceiling, or a pivot at zero
    GLITCH_SMALL = 0x02  # robust: a measurement was given less weight
    GLITCH_LARGE = 0x04  # robust: a measurement was given no weight
    ANOMALY = 0x08  # adaptive: the covariance was inflated; gate: reset after too many rejections
    GATED = 0x10  # the vector was rejected, the filter is unchanged
    SATURATED = 0x20  # a fixed-point value reached the end of its range, or a function of its domain
    DT_CLAMPED = 0x40  # dt was outside [min, max]
    POINT_REJECTED = 0x80  # a sigma point was replaced
    NULL_ARGUMENT = 0x100
    NOT_FINITE = 0x200  # an argument or a model value is NaN or infinite
    NOT_POSITIVE = 0x400  # a variance is negative beyond round-off, or dt <= 0


ERROR = 0x100
"""Statuses of this value and above are errors: the filter is what it was before the call."""


def describe(status: int) -> str:
    """The names of the bits that are set, as `GATED | DT_CLAMPED`; `OK` for 0.

    >>> describe(0x50)
    'GATED | DT_CLAMPED'
    """
    names = [flag.name or "" for flag in Status if flag and status & flag]
    unknown = status & ~sum(Status)
    return " | ".join(names + ([f"0x{unknown:x}"] if unknown else [])) or "OK"
