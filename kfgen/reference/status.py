"""The status bits that a filter's functions return."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """0 is OK; bits below ERROR are warnings; an error is returned alone, without warnings."""

    OK = 0
    REGULARIZED = 0x01
    GLITCH_SMALL = 0x02
    GLITCH_LARGE = 0x04
    ANOMALY = 0x08
    GATED = 0x10
    SATURATED = 0x20
    DT_CLAMPED = 0x40
    POINT_REJECTED = 0x80
    ERROR = 0x100
    NULL_ARGUMENT = 0x100
    NOT_FINITE = 0x200
    NOT_POSITIVE = 0x400
    TOO_OLD = 0x800


class StepError(Exception):
    """Abandons a step; `status` is the one error bit it is to return. Never leaves kfgen.reference."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.name)
        self.status = status
