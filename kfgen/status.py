"""The status word every function of a filter returns: the same bits in the emitted C and in Python."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """A bit mask. Below ERROR are warnings; an error is exactly one bit, and no warning stands beside it.

    doc: what the bit tells, as the header of a filter says it.
    """

    doc: str

    def __new__(cls, bit: int, doc: str = "") -> Status:
        self = int.__new__(cls, bit)
        self._value_ = bit
        self.doc = doc
        return self

    OK = 0x000
    REGULARIZED = 0x001, "a variance was limited, or taken to zero by round-off"
    GLITCH_SMALL = 0x002, "an innovation was weighted down"
    GLITCH_LARGE = 0x004, "an innovation was cut off"
    ANOMALY = 0x008, "an innovation beyond its variance was taken all the same"
    GATED = 0x010, "the measurement was refused; nothing but nis has changed"
    SATURATED = 0x020, "a number was clipped to its range"
    DT_CLAMPED = 0x040, "dt was outside of its limits and was clamped"
    POINT_REJECTED = 0x080, "a sigma point was replaced"
    NULL_ARGUMENT = 0x100, "a pointer is NULL"
    NOT_FINITE = 0x200, "an argument or a value of the model is NaN or infinite"
    NOT_POSITIVE = 0x400, "a variance or dt is not positive"
    TOO_OLD = 0x800, "the measurement is older than the history, or its step is full"


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
