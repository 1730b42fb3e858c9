"""What a bank costs on a Cortex-M4F, beside its ceilings; other implementations take 10,404 instructions, 8.5 kB of
flash and 824 bytes of RAM."""

from __future__ import annotations

import pytest

from kfgen.cost import Cost, measure
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.benchmarks.budgets import Ceiling
from tests.oracle.problems import IMM3

MOST = Ceiling(instructions=1300, flash=4500, ram=200, stack=200)


def cost(text: str) -> Cost:
    spec = override(loads(text), "float")
    return measure(build(spec), simulate(spec, 40))


@pytest.mark.usefixtures("_tools")
def test_two_filters_of_three_states():
    found = cost(IMM3)
    assert MOST.exceeded(found) == []


@pytest.mark.usefixtures("_tools")
def test_modes_that_never_switch_are_not_mixed():
    apart = cost(IMM3.replace("[[0.95, 0.05], [0.05, 0.95]]", "[[1, 0], [0, 1]]"))
    assert sum(apart.instructions["predict"]) < 0.4 * sum(cost(IMM3).instructions["predict"])
