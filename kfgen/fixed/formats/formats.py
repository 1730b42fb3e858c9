"""Binary points: the value of raw 1 of every cell is 2^e, with e from what the runs have met, unless it was chosen.

Of what is not chosen: from the largest value of the runs with HEADROOM bits above it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from kfgen.fixed.arithmetic.limits import BITS, OUTSIDE
from kfgen.fixed.program.cells import Arrays, Cell, plain
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.ir.nodes import Node

HEADROOM = 2  # bits above the largest value of the runs
COVARIANCE = 2  # the same for P, which an outage in the runs has driven further than most will
PASSING = 1  # the same for what is not kept
SLACK = 1.02  # of a run's figures, so that the last digit of a platform's libm decides nothing


def above(value: float) -> int:
    """The least k with value < 2^k; of a run's figure, with slack."""
    return math.frexp(abs(value) * SLACK)[1] if value else -1022


def exponent(value: float, headroom: int, bits: int = BITS) -> int:
    """The e at which value has that many bits of head-room."""
    return above(value) + headroom - bits


@dataclass
class Quantity:
    """One line of the report: what it is, the range that was reckoned with, its LSB's exponent, spare bits."""

    name: str
    largest: float
    e: int
    raised: str = ""
    bits: int = OUTSIDE

    @property
    def headroom(self) -> int:
        """Bits between the largest value and the format's end."""
        return self.e + self.bits - above(self.largest)


@dataclass
class Formats:
    """Cell -> exponent of its LSB; what is not known is looked up in the ranges of the runs."""

    arrays: Arrays
    ranges: Ranges
    bits: int  # n of q<m>.<n>
    more: int = 0  # further head-room
    spare: int = 0  # that of covariances
    fixed: dict[Cell, int] = field(default_factory=dict)
    report: list[Quantity] = field(default_factory=list)
    carried: dict[Cell, int] = field(default_factory=dict)  # cells with digits below their LSB -> place in kf.rest
    sizes: Mapping[Node, float] = field(default_factory=dict)  # what no value exceeds anywhere in the declared box
    fitting: dict[int, Node] = field(default_factory=dict)  # operations, by id, of which that shows that they fit

    def of(self, cell: Cell) -> int | None:
        """The exponent of a cell; None where the runs have told nothing."""
        found = self.fixed.get(cell)
        if found is None:
            largest = self.ranges.largest(cell)
            if largest == 0:
                return None
            covariance = cell[0] == "array" and plain(str(cell[1])) in ("kf.D", "kf.P")
            kept = COVARIANCE + self.spare if covariance else HEADROOM + self.more
            found = self.fixed[cell] = exponent(largest, kept)
        return found

    def node(self, node: Node, headroom: int = PASSING) -> int | None:
        """The exponent for the value of a node."""
        largest = self.ranges.largest(node)
        return exponent(largest, headroom + self.more) if largest else None

    def least(self, node: Node) -> int | None:
        """The finest exponent at which the runs' values still fit, with a little to spare."""
        largest = self.ranges.largest(node)
        return exponent(1.25 * largest, self.more) if largest else None
