"""What options add to the instructions of a filter on a Cortex-M4F."""

from __future__ import annotations

from functools import cache

import pytest

from kfgen.cost import Cost, measure
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.oracle import problems

MOST = 1.25  # times what the filter without the option takes


@cache
def cost(options: str) -> Cost:
    """cv4, ud + bierman, on readings of which one in twenty is an outlier."""
    spec = override(loads(problems.CV4.replace("{type: ekf}", f"{{type: ekf{options}}}")), "float")
    log = simulate(spec, 60, 1)
    log.columns["gnss.x"][::20] += 200
    return measure(build(spec), log)


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("options", ["robust: chernodarov", "adaptive: true"])
def test_robust_and_adaptive(options):
    plain, other = cost(""), cost(f", {options}")
    assert other.instructions["predict"] == plain.instructions["predict"]
    assert plain.step < other.step <= MOST * plain.step
    assert other.ram == plain.ram
    assert other.stack <= 160
