"""Scheduling of values that are read before something overwrites them: they keep what they were."""

from __future__ import annotations

from kfgen.ir.interpret import Memory, run
from kfgen.ir.program import Argument, Function, Let, walk
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.scalars import SCALARS

DOUBLE = SCALARS["double"]


def executed(t: Trace, x: list[float]) -> list[float]:
    """kf.x after the function."""
    held = Memory()
    held.arrays["kf.x"] = [DOUBLE.convert(v) for v in x]
    run(Function("test", [], schedule(t), ""), DOUBLE, held)
    return held.arrays["kf.x"]


def doubling() -> Function:
    """A private function that doubles two numbers in place."""
    t = Trace()
    for i in range(2):
        t.store("x", i, t.element("x", i) * 2)
    return Function(
        "twice", [Argument("x", "real", pointer=True, constant=False, size=2)], schedule(t), "", "void", private=True
    )


def test_an_array_read_before_it_is_overwritten():
    t = Trace()
    row = t.array("row", 2)
    row[0] = t.element("kf.x", 0)
    row[1] = t.element("kf.x", 1)
    a, b = row[0], row[1]
    product = a * b + 1  # not named, used once
    row[0] = b
    row[1] = t.value(7)
    t.store("kf.x", 0, row[0] - row[1])
    t.store("kf.x", 1, product)
    assert executed(t, [2, 3]) == [3 - 7, 7]


def test_a_variable_read_before_it_is_set():
    t = Trace()
    total = t.variable("total", 1)
    before = total.get()
    twice = before + before
    total.set(total.get() * 10)
    after = total.get()
    t.store("kf.x", 0, before)
    t.store("kf.x", 1, twice)
    t.store("kf.x", 2, after)
    assert executed(t, [0, 0, 0]) == [1, 2, 10]


def test_a_value_from_before_a_loop():
    t = Trace()
    row = t.array("row", 3)
    for i in range(3):
        row[i] = t.element("kf.x", i)
    first, sum_before = row[0], row[1] + row[2]
    with t.loop("k", 0, 3) as k:
        row[k] = row[k] * first
    t.store("kf.x", 0, row[0])
    t.store("kf.x", 1, sum_before)
    t.store("kf.x", 2, row[2] - first)
    assert executed(t, [2, 3, 4]) == [4, 7, 6]


def test_a_value_from_before_a_branch():
    for flag, expected in ((1, [5, 2]), (-1, [2, 2])):
        t = Trace()
        row = t.array("row", 1)
        row[0] = t.element("kf.x", 0)
        before = row[0]
        with t.when(t.element("kf.x", 1) > 0):
            row[0] = t.value(5)
        t.store("kf.x", 0, row[0])
        t.store("kf.x", 1, before)
        assert executed(t, [2, flag]) == expected


def test_a_value_from_before_a_call():
    t = Trace()
    row = t.array("row", 3)
    for i in range(3):
        row[i] = t.element("kf.x", i)
    old = [row[i] for i in range(3)]
    t.call(doubling(), [("row", 1)])
    for i in range(3):
        t.store("kf.x", i, row[i])
        t.store("kf.x", 3 + i, old[i] * 3)
    assert executed(t, [1, 2, 3, 0, 0, 0]) == [1, 4, 6, 3, 6, 9]


def test_values_within_a_loop():
    """A deviation overwrites its point: what was read in the same turn is still the point."""
    t = Trace()
    row, total = t.array("row", 4), t.variable("total", 0)
    for i in range(4):
        row[i] = t.element("kf.x", i)
    with t.loop("k", 0, 2) as k:
        own, next_one = row[k * 2], row[k * 2 + 1]
        difference = own - next_one
        t.call(doubling(), [("row", k * 2)])
        called = row[k * 2]
        row[k * 2] = difference
        total.set(total.get() + own * called)
    t.store("kf.x", 0, row[0])
    t.store("kf.x", 1, row[2])
    t.store("kf.x", 2, row[1])
    t.store("kf.x", 3, total.get())
    assert executed(t, [1, 3, 10, 4]) == [-2, 6, 6, 2 + 200]


def test_what_nothing_overwrites_is_not_kept():
    """No local is made for a value that is used once and stays what it is."""
    t = Trace()
    row = t.array("row", 2)
    row[0] = t.element("kf.x", 0)
    t.store("kf.x", 1, row[0] * 2 + 1)
    assert not [s for s in walk(schedule(t)) if isinstance(s, Let)]
