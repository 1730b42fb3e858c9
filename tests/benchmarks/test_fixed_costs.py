"""No filter in integers costs more on a Cortex-M0 than its ceiling; on an AVR it costs less than plain C."""

from __future__ import annotations

import pytest

from tests.benchmarks.fixed import cost

CEILINGS = {
    ("cv4", "full"): (3000, 2100),
    ("cv4", "ud"): (6500, 4000),
    ("ball", "full"): (1700, 1500),
    ("ball", "ud"): (3200, 2400),
}
"""(problem, form) -> instructions of one predict and one update, bytes of flash with what is linked."""


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize(("name", "covariance"), CEILINGS)
def test_cost(name, covariance):
    found = cost(name, covariance, "cortex-m0")
    instructions, flash = CEILINGS[name, covariance]
    assert found.errors == 0
    assert found.step <= instructions
    assert found.flash_linked <= flash


def test_an_avr_gains_by_products_of_its_own(needs):
    needs("avr-gcc", "simavr")
    ours, plain = cost("cv4", "full", "avr"), cost("cv4", "full", "avr", plain=True)
    assert ours.errors == plain.errors == 0
    assert ours.step < 0.6 * plain.step
    assert ours.flash_linked < 0.6 * plain.flash_linked
