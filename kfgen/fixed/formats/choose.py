"""The formats of a filter: of what the user reads or writes, of its covariance, and what is carried on below an LSB."""

from __future__ import annotations

from collections.abc import Mapping

from kfgen.filters.base import FilterCode
from kfgen.fixed.formats.carried import carry
from kfgen.fixed.formats.covariance import covariances
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.formats.interface import Interface
from kfgen.fixed.program.cells import Arrays
from kfgen.fixed.ranges.pace import Pace
from kfgen.fixed.ranges.ranges import Ranges
from kfgen.ir.nodes import Node

MORE = 2  # bits of head-room where gains depend on the data, so that no run shows their largest values


def choose(code: FilterCode, arrays: Arrays, ranges: Ranges, bits: int, linear: bool,
           noise: list[list[float]], pace: Pace, sizes: Mapping[Node, float], spare: int) -> Formats:  # fmt: skip
    """The formats of the interface and of the covariance; all others follow from the ranges.

    linear: the covariance does not depend on the data. noise: what a step adds to each variance (modes, n).
    pace: what the steps of a run changed. sizes: what values cannot exceed anywhere in the declared box. spare: bits of
    further head-room that covariances get where they depend on the data.
    """
    formats = Formats(arrays, ranges, bits, 0 if linear else MORE, 0 if linear else spare, sizes=sizes)
    Interface(code, formats).choose()
    covariances(code, formats, noise)
    carry(code, formats, pace)
    return formats
