"""How errors are seen from where rotations have been turned to (Mueller, Hehn & D'Andrea 2017)."""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.filters.algebra.linalg import Rows
from kfgen.geometry import Turn
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.rotations import RotationModel


def moving(t: Trace, model: Model, order: Sequence[int], turns: list[tuple[RotationModel, Turn]]) -> Rows:
    """T (n, n) in the inner order."""
    return _in_order(t, order, [(r, r.geometry.moved(turn)) for r, turn in turns])


def seen_at(t: Trace, model: Model, order: Sequence[int], apart: Sequence[Value]) -> Rows:
    """d((x [+] e) [-] b)/de in the inner order, for x [-] b = apart (n,) in the spec's order."""
    blocks = []
    for r in model.rotations:
        turn = Turn(apart[r.first_error : r.first_error + 3])
        blocks.append((r, turn.inverse(r.geometry.body)))
    return _in_order(t, order, blocks)


def _in_order(t: Trace, order: Sequence[int], blocks: list[tuple[RotationModel, Rows]]) -> Rows:
    n = len(order)
    T = [[t.one if i == j else t.zero for j in range(n)] for i in range(n)]
    for r, block in blocks:
        for i in range(3):
            for j in range(3):
                T[r.first_error + i][r.first_error + j] = t.value(block[i][j])
    return [[T[i][j] for j in order] for i in order]
