"""Interval arithmetic: no value of a function at points of its spans is outside of what is told of it."""

from __future__ import annotations

import math
import random

import pytest

from kfgen.fixed.ranges import arithmetic as reckon
from kfgen.ir.nodes import Table

FUNCTIONS = {
    "neg": lambda a: -a, "abs": abs, "sin": math.sin, "cos": math.cos, "tan": math.tan, "sqrt": math.sqrt,
    "asin": math.asin, "acos": math.acos, "atan": math.atan, "exp": math.exp, "sinh": math.sinh, "tanh": math.tanh,
    "cosh": math.cosh, "log": math.log, "floor": math.floor, "sign": lambda a: (a > 0) - (a < 0),
}  # fmt: skip
PAIRS = {"div": lambda a, b: a / b, "atan2": math.atan2, "pow": math.pow, "min": min, "max": max}


def spans(source, low, high):
    a, b = sorted(source.choice((source.uniform(low, high), float(source.randint(-3, 3)))) for _ in range(2))
    return max(a, low), min(b, high)


def points(source, span):
    return [*span, *(source.uniform(*span) for _ in range(20))]


def inside(value, found):
    return found[0] - 1e-9 * (1 + abs(value)) <= value <= found[1] + 1e-9 * (1 + abs(value))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions(name):
    source, told = random.Random(name), 0
    low, high = {"sqrt": (0, 9), "log": (0, 9), "asin": (-1, 1), "acos": (-1, 1)}.get(name, (-9, 9))
    for _ in range(300):
        span = spans(source, low, high)
        if span[0] > span[1]:
            continue
        found = reckon.UNARY[name](span)
        if found is not None:
            told += 1
            assert all(inside(FUNCTIONS[name](a), found) for a in points(source, span)), span
    assert told > 50


@pytest.mark.parametrize("name", PAIRS)
def test_functions_of_two(name):
    source, told = random.Random(name), 0
    for _ in range(400):
        a, b = spans(source, 0.1 if name == "pow" else -5, 5), spans(source, -5, 5)
        if a[0] > a[1]:
            continue
        found = reckon.BINARY[name](a, b)
        if found is not None:
            told += 1
            for x in points(source, a):
                for y in points(source, b):
                    assert inside(PAIRS[name](x, y), found), (a, b)
    assert told > 50


def test_a_table_between_its_points():
    table = Table((0, 1, 3), (5, -2, 4))
    assert reckon.looked_up(table, (-1, 0.5)) == (1.5, 5)
    assert reckon.looked_up(table, (0.5, 9)) == (-2, 4)


def test_squares_and_wraps():
    assert reckon.square((-2, 1)) == (0, 4)
    assert reckon.wrapped((-1, 2), 2 * math.pi) == (-1, 2)
    assert reckon.wrapped((-1, 4), 2 * math.pi) == (-math.pi, math.pi)
