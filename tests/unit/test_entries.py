"""Entries of a covariance under names: what is read, when, and that a written one is another value."""

from __future__ import annotations

from fractions import Fraction

from kfgen.emit.entries import Entry, with_entries
from kfgen.filters.covariance.full.store import FullStore
from kfgen.filters.covariance.names import LONGEST, entries, entry, entry_next
from kfgen.filters.covariance.sqrt.store import SqrtStore
from kfgen.filters.covariance.ud.store import UDStore
from kfgen.ir.interpret import Memory, run
from kfgen.ir.program import Argument, Call, Function, Let, Statement
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.scalars import SCALARS

ENTRIES = {("kf.P", i): Entry(name) for i, name in enumerate(("p_a_a", "p_a_b", "p_b_b"))}
KF = Argument("kf", "{name}_t", pointer=True, constant=False)


def named(trace: Trace, prefix: str = "unit") -> list[Statement]:
    return with_entries(schedule(trace), ENTRIES, frozenset(), prefix)


def lets(body: list[Statement]) -> list[str]:
    return [s.name for s in body if isinstance(s, Let)]


def outcome(body: list[Statement]) -> list[float]:
    memory = Memory({"kf.P": [2.0, 3.0, 5.0]}, {"kf.nis": 0.0})
    run(Function("f", [KF], body, ""), SCALARS["double"], memory)
    return [*memory.arrays["kf.P"], memory.numbers["kf.nis"]]


def test_a_number_is_read_once_right_before_its_first_use():
    t = Trace()
    P = [t.element("kf.P", i) for i in range(3)]
    t.store("kf.P", 2, t.name(P[2] * P[2], "p_b_b_next"))
    t.store("kf.nis", None, P[0] + P[0])
    body = named(t)
    assert [getattr(s, "name", "") for s in body] == ["p_b_b", "p_b_b_next", "kf.P", "p_a_a", "kf.nis"]
    assert outcome(body) == outcome(schedule(t)) == [2.0, 3.0, 25.0, 4.0]


def test_what_is_written_before_it_is_read_is_kept_under_its_name():
    t = Trace()
    old = t.element("kf.P", 0)
    t.store("kf.P", 0, t.element("kf.P", 1) * 2)
    t.store("kf.P", 1, old + 1)
    body = named(t)
    assert sorted(lets(body)) == ["p_a_a", "p_a_b"]
    assert outcome(body) == outcome(schedule(t)) == [6.0, 3.0, 5.0, 0.0]


def test_what_the_program_holds_is_read_no_sooner_than_it_is_used():
    t = Trace()
    old = t.element("kf.P", 0)  # held from here on by the program, since it is written before its last use
    double = t.name(t.element("kf.P", 1) * 2, "double")
    t.store("kf.nis", None, double + old)
    t.store("kf.P", 0, double)
    t.store("kf.P", 1, old)
    body = named(t)
    assert lets(schedule(t)) == ["t0", "double"]
    assert lets(body) == ["p_a_b", "double", "p_a_a"]
    assert outcome(body) == outcome(schedule(t)) == [6.0, 2.0, 5.0, 8.0]


def test_loops_and_branches_read_as_they_do():
    t = Trace()
    with t.loop("i", 0, 3) as i:
        t.store("kf.P", i, t.element("kf.P", i) * 2)
    with t.when(t.field("kf.nis") < 1):
        t.store("kf.nis", None, t.element("kf.P", 0) + 1)
    body = named(t)
    assert lets(body) == []
    assert outcome(body) == outcome(schedule(t)) == [4.0, 6.0, 10.0, 5.0]


def test_a_call_that_may_write_ends_a_name():
    t = Trace()
    doubled = Trace()
    doubled.store("kf.P", 1, doubled.element("kf.P", 1) * 2)
    before = t.name(t.element("kf.P", 1) + 1, "before")
    t.store("kf.nis", None, before)
    t.call(Function("double", [KF], schedule(doubled), "", returns="void", private=True), ["kf"])
    after = Trace()
    after.store("kf.P", 0, after.element("kf.P", 1) * 1)
    body = with_entries([*schedule(t), *schedule(after)], ENTRIES, frozenset(), "unit")
    assert lets(body) == ["p_a_b", "before"]
    assert isinstance(body[-2], Call)
    assert outcome(body) == [6.0, 6.0, 5.0, 4.0]


def test_names_that_are_taken_get_a_number():
    t = Trace()
    t.store("kf.nis", None, t.name(t.element("kf.P", 0) * t.element("kf.P", 1), "p_a_a") + 1)
    assert lets(named(t)) == ["p_a_a_1", "p_a_b", "p_a_a"]
    assert lets(named(t, prefix="p")) == ["p_a_a_1", "p_a_b_1", "p_a_a"]  # p_... may be a function of the filter


def test_entries_are_named_in_the_order_of_the_arrays():
    names, P0 = ["a", "b", "c"], [[Fraction(i == j) for j in range(3)] for i in range(3)]
    (P,), (U, D) = FullStore(3).blocks(P0, names), UDStore([0, 1, 2]).blocks(P0, names)
    (S,) = SqrtStore(3).blocks(P0, names[::-1])
    assert P.entries == ("p_a_a", "p_a_b", "p_b_b", "p_a_c", "p_b_c", "p_c_c")
    assert U.entries == ("u_a_b", "u_a_c", "u_b_c")
    assert D.entries == ("d_a", "d_b", "d_c")
    assert S.entries == ("s_a_a", "s_b_a", "s_b_b", "s_c_a", "s_c_b", "s_c_c")


def test_long_names_give_way_to_places():
    names = ["x" * 40, "y" * 40, "z"]
    assert entry("p", names, 0, 1) == "p_0_1"
    assert entry_next("d", names, 1) == f"d_{'y' * 40}_next"
    assert all(len(name) <= LONGEST for name in entries("p", names))
