"""A filter of real numbers to one of integers: its functions, what it stores, its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import cast

from kfgen.filters.base import Block, FilterCode
from kfgen.fixed.arithmetic.limits import FINE
from kfgen.fixed.arithmetic.rounding import rounded
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.lowering.raw import Context, QTable
from kfgen.fixed.lowering.statements import Statements
from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import Function

PROBABILITY = "what mu has below its LSB"
REST = "what x and the variances have below their LSB, by 2^-16 of it"


def lower(code: FilterCode, formats: Formats) -> FilterCode:
    """The filter in integers."""
    tables: dict[Table, QTable] = {}
    lookups: dict[Constants, tuple[Constants, int]] = {}
    done: dict[str, Function] = {}
    for f in code.functions:
        context = Context(f, formats, formats.arrays, tables, lookups)
        done[f.name] = Statements(context, done).function()
    blocks = []
    for block in code.blocks:
        cells = [formats.arrays.element(("array", f"kf.{block.name}"), i) for i in range(len(block.initial))]
        points = tuple(-formats.bits if e is None else e for e in map(formats.of, cells))
        initial = tuple(Fraction(rounded(value, e)) for value, e in zip(block.initial, points, strict=True))
        blocks.append(replace(block, initial=initial, points=points))
    if code.modes and formats.bits < FINE:
        blocks.append(Block("rest", len(code.modes), PROBABILITY, initial=tuple(_rests(code, formats))))
    if formats.carried:
        size = len(formats.carried)
        blocks.append(Block("rest", size, REST, initial=(Fraction(0),) * size))
    return replace(
        code, blocks=tuple(blocks), functions=tuple(done.values()),
        tables=cast(Mapping[Table, str], {tables[t]: name for t, name in code.tables.items() if t in tables}),
        lookups={lookups[c][0]: name for c, name in code.lookups.items() if c in lookups}, constants={},
    )  # fmt: skip


def _rests(code: FilterCode, formats: Formats) -> Iterator[Fraction]:
    """What mu0 has below its LSB."""
    (mu,) = (block for block in code.blocks if block.name == "mu")
    for value in mu.initial:
        yield Fraction(rounded(value, -FINE) - (rounded(value, -formats.bits) << (FINE - formats.bits)))
