"""What an update works with, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.covariance.base import Form
from kfgen.filters.covariance.parts import Learning
from kfgen.filters.steps.adapt import AdaptedR
from kfgen.filters.steps.compensation import Rests
from kfgen.filters.steps.sensor import SensorCode
from kfgen.geometry import Turn
from kfgen.ir.trace import Trace, Value
from kfgen.model.model import SensorModel


@dataclass
class Update:
    """What an update of one sensor works with. used: whether each component counts, where a mask tells."""

    t: Trace
    sensor: SensorModel
    code: SensorCode
    x: list[Value]  # in the spec's order
    form: Form[Any]
    used: list[Value] | None
    adapted: AdaptedR | None
    tested: list[Value] = field(default_factory=list)  # what else has to be finite
    rests: Rests = field(default_factory=dict)  # of compensated states, after the update
    turns: list[Turn] = field(default_factory=list)  # of the rotations, by the update
    base: list[Value] | None = None  # the state about which the rotations are turned, if it is not x
    apart: list[Value] | None = None  # base [-] x
    free: list[Value] = field(default_factory=list)  # x after the update, before bounds

    @cached_property
    def P(self) -> Any:
        """As it stands in the struct, read when it is first needed."""
        return self.form.load(self.t)


@dataclass
class Learnt:
    """What an update leaves for an adapted R (m,), and the next Q."""

    residual: Vector = field(default_factory=list)
    Q: Learning | None = None
