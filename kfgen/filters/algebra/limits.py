"""Floors and ceilings of the variances of U D U^T: of P_ii itself, whatever the order of the states."""

from __future__ import annotations

from fractions import Fraction

from kfgen.filters.algebra.linalg import Rows, Vector, times
from kfgen.filters.algebra.numbers import Number, assume_nonnegative, select, sqrt
from kfgen.filters.algebra.rank_one import rank_one
from kfgen.filters.algebra.symmetric import assembled

Limits = list[Fraction | None]


def margin(n: int, epsilon: Fraction) -> Fraction:
    """How far, relative, a variance that was put on a limit may be found beyond it by round-off."""
    return 4 * n * epsilon


def raised(U: Rows, D: Vector, floors: Limits, epsilon: Fraction) -> dict[int, Number]:
    """P_ii raised to the floors, in place: + (f - P_ii) e_i e_i^T. Returns where that was so."""
    n = len(D)
    P = assembled(U, D)
    below: dict[int, Number] = {}
    columns: list[tuple[Vector, Number, int]] = []
    for i, floor in enumerate(floors):
        if floor is not None:
            below[i] = P[i, i] < floor * (1 - margin(n, epsilon))
            lack = assume_nonnegative(select(below[i], floor - P[i, i], 0))
            columns.append(([int(k == i) for k in range(n)], lack, -1))
    rank_one(U, D, columns)
    return below


def lowered(U: Rows, D: Vector, ceilings: Limits, epsilon: Fraction) -> dict[int, Number]:
    """Row and column i of P scaled by sqrt(c / P_ii), in place, where P_ii is above the ceiling. Returns where."""
    n = len(D)
    P = assembled(U, D)
    above: dict[int, Number] = {}
    squares: dict[int, Number] = {}
    for i, ceiling in enumerate(ceilings):
        if ceiling is not None:
            above[i] = P[i, i] > ceiling * (1 + margin(n, epsilon))
            squares[i] = assume_nonnegative(select(above[i], ceiling / P[i, i], 1))
    for i, square in squares.items():
        D[i] = assume_nonnegative(times(D[i], square))
        scale = select(above[i], sqrt(square), 1)
        inverse = select(above[i], 1 / scale, 1)
        for j in range(i + 1, n):
            U[i][j] = times(U[i][j], scale)
        for k in range(i):
            U[k][i] = times(U[k][i], inverse)
    return above
