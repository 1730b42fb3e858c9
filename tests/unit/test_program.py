"""Nodes, tracing and scheduling: what is folded, what is shared, what is kept from being overwritten."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest

from kfgen.generate import generate
from kfgen.ir.count import operations
from kfgen.ir.interpret import Memory, run
from kfgen.ir.nodes import Pool, Table
from kfgen.ir.program import Function, Let, Store
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.scalars import SCALARS
from kfgen.spec import loads

DOUBLE, FLOAT = SCALARS["double"], SCALARS["float"]


def executed(t: Trace, scalar=DOUBLE, **memory):
    """Schedule and run; returns the statements, the memory and the flags."""
    body = schedule(t)
    held = Memory()
    for name, value in memory.items():
        if isinstance(value, list):
            held.arrays[f"kf.{name}"] = [scalar.convert(v) for v in value]
        else:
            held.numbers[f"kf.{name}"] = scalar.convert(value)
    flags = run(Function("test", [], body, ""), scalar, held)
    return body, held, flags


# folding and sharing ---------------------------------------------------------------------------------


def test_zeros_and_ones_fold():
    p = Pool()
    a = p.make("field", (), "a")
    assert p.add(a, p.zero) is a
    assert p.add(p.zero, a) is a
    assert p.sub(a, p.zero) is a
    assert p.sub(a, a).constant == 0
    assert p.mul(a, p.one) is a
    assert p.mul(p.zero, a).constant == 0
    assert p.neg(p.neg(a)) is a
    assert p.div(p.zero, a).constant == 0
    assert p.mul(a, p.constant(-1)) is p.neg(a)
    assert p.select(p.boolean(True), a, p.zero) is a
    assert p.select(p.less(a, p.one), a, a) is a
    assert p.less(p.zero, p.one).constant == 1
    assert p.negate(p.negate(p.less(a, p.one))) is p.less(a, p.one)


def test_equal_expressions_are_one_node():
    p = Pool()
    a, b = p.make("field", (), "a"), p.make("field", (), "b")
    assert p.add(a, b) is p.add(b, a)
    assert p.mul(a, b) is p.mul(b, a)
    assert p.mul(p.neg(a), p.neg(b)) is p.mul(a, b)
    assert p.mul(p.constant(2), p.mul(p.constant(3), a)) is p.mul(p.constant(6), a)
    assert p.function("sin", a) is p.function("sin", a)
    assert p.sub(a, b) is not p.sub(b, a)
    assert p.table(a, Table((Fraction(0), Fraction(1)), (Fraction(0), Fraction(1)))) is p.table(
        a, Table((Fraction(0), Fraction(1)), (Fraction(0), Fraction(1)))
    )


def test_constants_are_exact():
    p = Pool()
    half, tenth = p.constant(Fraction(1, 2)), p.constant(Fraction(1, 10))
    assert p.mul(half, p.mul(tenth, tenth)).constant == Fraction(1, 200)
    assert p.div(p.one, p.constant(3)).constant == Fraction(1, 3)
    assert p.function("floor", p.constant(Fraction(-7, 2))).constant == -4
    assert p.function("sqrt", p.constant(4)).constant == 2
    assert p.function("sqrt", p.constant(-4)).constant is None  # left to run time
    root = p.function("sqrt", p.constant(2)).constant
    assert root is not None
    assert abs(root**2 - 2) < Fraction(1, 10**50)


def test_emitted_constants_are_rounded_once():
    """0.5*0.1**2 is 0.005f, though 0.1f*0.1f*0.5f is not."""
    text = """
kfgen: 1
name: tiny
dt: 0.1
states: {p: {init: 0, var: 1}, a: {init: 0.1, var: 1/3}}
dynamics: {form: discrete, f: {p: p + 0.5*dt**2*a}, Q: {a: 1}}
measurements: {s: {z: {z: {h: p, std: 1}}}}
filter: {type: ekf}
"""
    source = generate(loads(text), "float")["tiny.c"]
    assert re.search(r"\b0\.005f\b", source)
    assert re.search(r"\b0\.33333334f\b", source)
    assert re.search(r"\b0\.1f\b", source)
    assert re.search(r"\b0\.005\b(?!f)", generate(loads(text), "double")["tiny.c"])


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_literals_read_back(scalar):
    kind = SCALARS[scalar]
    random = np.random.default_rng(0)
    dtype = np.float32 if scalar == "float" else np.float64
    exponents = random.integers(-37, 37, 300)
    values = [
        Fraction(float(v)) * Fraction(10) ** int(e) for v, e in zip(random.normal(size=300), exponents, strict=True)
    ]
    values += [Fraction(0), Fraction(1), Fraction(-1), Fraction(1, 3), Fraction(10**7), Fraction(2) ** -149]
    for value in values:
        text = kind.literal(value)
        assert text.endswith("f") == (scalar == "float")
        assert re.fullmatch(r"-?\d+\.\d+(e-?\d+)?f?", text), text
        assert dtype(text.rstrip("f")) == kind.convert(value)
        assert Fraction(float(kind.convert(value))) == kind.nearest(value)


def test_nearest_rounds_half_to_even():
    assert FLOAT.nearest(1 + Fraction(1, 2**24)) == 1
    assert FLOAT.nearest(1 + Fraction(3, 2**24)) == 1 + Fraction(1, 2**22)
    assert FLOAT.nearest(1 + Fraction(1, 2**24) + Fraction(1, 2**60)) == 1 + Fraction(1, 2**23)
    assert FLOAT.nearest(Fraction(1, 2**150)) == 0
    assert DOUBLE.nearest(Fraction(1, 10)) == Fraction(0.1)


# scheduling ------------------------------------------------------------------------------------------


def test_fields_read_after_their_store_keep_the_old_value():
    """A swap: what is read after it has been stored was meant as it stood when the function began."""
    t = Trace()
    a, b = t.element("kf.x", 0), t.element("kf.x", 1)
    t.store("kf.x", 0, b)
    t.store("kf.x", 1, a)
    body, memory, _ = executed(t, x=[1, 2])
    assert memory.arrays["kf.x"] == [2, 1]
    assert sum(isinstance(s, Let) for s in body) == 1


def test_snapshots_reach_into_expressions():
    t = Trace()
    x = [t.element("kf.x", i) for i in range(3)]
    nis = t.field("kf.nis")
    t.store("kf.nis", None, x[0] + x[1])
    t.store("kf.x", 0, x[1] * 2)
    t.store("kf.x", 1, x[0] + x[2] * nis)
    t.store("kf.x", 2, x[0] * x[1] + nis)
    _, memory, _ = executed(t, x=[1, 10, 100], nis=0.5)
    assert memory.numbers["kf.nis"] == 11
    assert memory.arrays["kf.x"] == [20, 1 + 50, 10.5]


def test_used_once_stands_inline_and_shared_is_named():
    t = Trace()
    a, b = t.element("kf.x", 0), t.element("kf.x", 1)
    shared = a * b
    t.store("kf.x", 2, shared + a)
    t.store("kf.x", 3, shared - b)
    dead = a * a * a
    assert dead.node is not shared.node
    body, memory, _ = executed(t, x=[2, 3, 0, 0])
    assert [type(s) for s in body] == [Let, Store, Store]
    assert memory.arrays["kf.x"] == [2, 3, 8, 3]
    assert operations(body) == {"mul": 1, "add": 2}


def test_names_are_kept_and_made_unique():
    t = Trace()
    first = t.name(t.element("kf.x", 0) + 1, "px")
    second = t.name(t.element("kf.x", 1) + 1, "px")
    third = t.name(t.element("kf.x", 2) + 1, "kf")
    for i, value in enumerate((first, second, third)):
        t.store("kf.x", i, value * value)
    names = [s.name for s in schedule(t, frozenset({"kf"})) if isinstance(s, Let)]
    assert names[0] == "px"
    assert len({*names, "kf"}) == 4


def test_a_sum_of_products_is_one_thing():
    t = Trace()
    x = [t.element("kf.x", i) for i in range(6)]
    t.store("kf.x", 0, x[0] * x[1] - x[2] * x[3] + x[4] - x[5])
    (store,) = schedule(t)
    assert isinstance(store, Store)
    assert store.node.op == "sum"
    assert store.node.data == ((1, 2), (-1, 2), (1, 1), (-1, 1))


def test_guards_end_before_any_store_and_flags_add_up():
    for value, flags, after in ((0.5, set(), 1.5), (2, {"REGULARIZED"}, 3), (5, {"NOT_POSITIVE"}, 5)):
        t = Trace()
        x = t.element("kf.x", 0)
        t.flag(x > 1, "REGULARIZED")
        t.guard(x > 4, "NOT_POSITIVE")
        t.guard(t.one < 0, "NOT_FINITE")  # known to be false: nothing
        t.store("kf.x", 0, x + 1)
        body, memory, found = executed(t, x=[value])
        assert found == flags
        assert memory.arrays["kf.x"] == [after]
        assert len(body) <= 4


def test_loops():
    """Pascal's triangle in an array: reads of what a loop has changed are made anew."""
    t = Trace()
    row = t.array("row", 5)
    with t.loop("i", 0, 5) as i:
        row[i] = 0
    row[0] = 1
    with t.loop("k", 0, 4), t.loop("j", 1, 5, down=True) as j:
        row[j] = row[j] + row[j - 1]
    total = t.variable("total", 0)
    with t.loop("i", 0, 5) as i:
        with t.when(i < 3):
            total.set(total.get() + row[i])
        t.store("kf.x", i, row[i])
    t.store("kf.nis", None, total.get())
    body, memory, _ = executed(t, x=[0] * 5, nis=0)
    assert memory.arrays["kf.x"] == [1, 4, 6, 4, 1]
    assert memory.numbers["kf.nis"] == 11
    assert operations(body) is None


def test_what_is_made_in_a_loop_stays_there():
    t = Trace()
    a = t.element("kf.x", 0)
    with t.loop("i", 0, 2) as i:
        t.store("kf.x", i + 1, a * a)
    t.store("kf.x", 3, a * a)  # the same product, but that of the loop is out of scope
    _, memory, _ = executed(t, x=[3, 0, 0, 0])
    assert memory.arrays["kf.x"] == [3, 9, 9, 9]


# arithmetic of the scalars -----------------------------------------------------------------------------


def test_wrap_stays_in_its_interval():
    random = np.random.default_rng(2)
    for scalar in (FLOAT, DOUBLE):
        for period in (Fraction(5), Fraction(1, 3), Fraction(6283185307, 10**9)):
            half = scalar.convert(period / 2)
            for a in [*random.normal(0, 100, 200), float(half), -float(half), 3 * float(half), 1e6]:
                value = scalar.evaluate("wrap", period, [scalar.convert(a)])
                assert -half < value <= half
                turns = (float(value) - a) / float(period)
                assert abs(turns - round(turns)) < 1e-3 * max(1, abs(a)) * float(scalar.epsilon) / 1e-7


def test_tables_are_clamped():
    table = Table((Fraction(-1), Fraction(0), Fraction(2)), (Fraction(3), Fraction(1), Fraction(2)))
    t = Trace()
    for i in range(7):
        x = t.element("kf.x", i)
        t.store("kf.y", i, t.table(x, table))
        t.store("kf.s", i, t.table(x, table, slope=True))
    _, memory, _ = executed(t, x=[-5, -1, -0.5, 0, 1, 2, 9], y=[0] * 7, s=[0] * 7)
    assert memory.arrays["kf.y"] == [3, 3, 2, 1, 1.5, 2, 2]
    assert memory.arrays["kf.s"] == [0, -2, -2, 0.5, 0.5, 0.5, 0]  # at the ends that of the inside
