"""What filters in loops cost on a Cortex-M4F, beside their ceilings; no budget is exceeded that loops keep."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import pytest

from kfgen.cost import Cost, measure, recommended_flags
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.spec.types import Spec
from tests.oracle import problems

# of chain16: instructions of one predict and one update, bytes of flash; bytes of stack with 16 states
CEILINGS = {("ud", "bierman"): (17000, 2290), ("full", "standard"): (9950, 2700)}
STACK = 1536
OTHERS = [("ud", "joseph", "consider: [v3], gain_limit: 0.9"), ("full", "joseph", "adaptive: true, robust: huber"),
          ("sqrt", None, "")]  # fmt: skip


def spec_of(n: int, covariance: str, update: str | None, unroll: str, options: str = "") -> Spec:
    keys = [f"covariance: {covariance}", f"update: {update}" if update else "", options]
    wanted = "".join(f", {key}" for key in keys if key)
    text, count = re.subn(r"^filter: .*$", f"filter: {{type: ekf{wanted}}}", problems.chain(n), flags=re.MULTILINE)
    assert count == 1
    spec = override(loads(text), "float")
    return replace(spec, code=replace(spec.code, unroll=unroll))


@cache
def cost(n: int, covariance: str, update: str | None, unroll: str = "none", options: str = "") -> Cost:
    spec = spec_of(n, covariance, update, unroll, options)
    generated = build(spec)
    return measure(generated, simulate(spec, 8), flags=recommended_flags(generated.view))


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("form", CEILINGS)
def test_ceilings(form):
    instructions, flash = CEILINGS[form]
    found = cost(16, *form)
    assert found.step <= instructions
    assert found.flash <= flash
    assert found.stack <= STACK


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize(("covariance", "update", "options"), OTHERS)
def test_stack_and_size_of_the_others(covariance, update, options):
    found = cost(16, covariance, update, "none", options)
    assert found.stack <= STACK
    assert found.flash <= 4224


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("form", CEILINGS)
def test_a_budget_that_loops_keep_is_kept(form):
    """What is measured of `auto` never exceeds a budget within which `none` is measured, or it is refused."""
    least = cost(8, *form).flash
    for budget in (least + 1, 2 * least, 3 * least):
        spec = spec_of(8, *form, "auto")
        spec = replace(spec, code=replace(spec.code, flash=budget))
        try:
            generated = build(spec)
        except SpecError:
            assert budget < 2 * least  # functions that are not measured here count too
            continue
        found = measure(generated, simulate(spec, 3), flags=recommended_flags(generated.view))
        assert found.flash <= budget
