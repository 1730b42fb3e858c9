"""Of states and components: x [+] d, a [-] b, in floats, fractions and traced values alike."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kfgen.geometry import Circle, Line, heaviest, part_of
from kfgen.ir.trace import Trace

ANGLES = st.floats(-50, 50)
PERIODS = st.sampled_from([2 * math.pi, 5.0, 1e-3])


@given(ANGLES, ANGLES, PERIODS)
def test_what_is_apart_by_a_difference_is_reached_by_it(a: float, b: float, period: float) -> None:
    for part in (Line(), Circle(period)):
        reached = part.retract(b, part.local(a, b))
        assert part.local(reached, a) == pytest.approx(0, abs=1e-12)


@given(ANGLES, PERIODS)
def test_a_place_on_a_circle_is_one_of_its_chart(a: float, period: float) -> None:
    placed = Circle(period).placed(a)
    assert -period / 2 < placed <= period / 2
    assert math.sin(2 * math.pi * (placed - a) / period) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("a", "placed"), [(-3, 3), (3, 3), (9, 3), (4, -2), ("7/2", "-5/2"), (0, 0)])
def test_fractions_are_placed_exactly(a: str, placed: str) -> None:
    assert Circle(Fraction(6)).placed(Fraction(a)) == Fraction(placed)
    assert Circle(6.0).placed(float(Fraction(a))) == float(Fraction(placed))


def test_what_is_not_finite_is_on_no_circle() -> None:
    assert math.isnan(Circle(6.0).placed(math.inf))
    assert math.isnan(Circle(6.0).local(1.0, math.nan))
    assert Line().local(math.inf, 1.0) == math.inf


def test_traced_values() -> None:
    t = Trace()
    a, b = t.field("a"), t.field("b")
    assert Circle(Fraction(6)).local(a, b).node.op == "wrap"
    assert Circle(Fraction(6)).placed(t.value(4)).constant == -2
    assert Line().local(a, b).node is (a - b).node


def test_the_base_of_a_mean_is_the_first_of_the_heaviest() -> None:
    def select(condition: bool, a: object, b: object) -> object:
        return a if condition else b

    assert heaviest(["a", "b", "c"], [0.2, 0.4, 0.4], select) == "b"
    assert part_of(None) == Line()
    assert part_of(2.0) == Circle(2.0)
