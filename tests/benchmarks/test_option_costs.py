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


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("form", ["ud", "full", "sqrt"])
def test_a_variance_that_is_never_zero(form):
    """Of a parameter whose range excludes 0, beside a constant one: a product."""

    def update(deviation: str, range: str) -> float:
        text = problems.CV4.replace("{type: ekf}", f"{{type: ekf, covariance: {form}}}").replace("var: 400", deviation)
        assert deviation in text
        text = text.replace("dt: 0.1", f"dt: 0.1\nparameters: {{sigma: {{value: 20, range: {range}}}}}", 1)
        spec = override(loads(text), "float")
        return measure(build(spec), simulate(spec, 20, 1)).instructions["update_gnss"][0]

    constant = update("std: 20", "[1, 50]")
    assert update("std: sigma", "[1, 50]") <= constant + 2 < update("std: sigma", "[0, 50]")
