"""No filter in integers costs more on a Cortex-M0 than its ceiling."""

from __future__ import annotations

import pytest

from kfgen.cost import measure
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.oracle import problems

ROWS = 20
SPECS = {"cv4": problems.CV4, "ball": problems.BALL}
FORMS = {"full": "standard", "ud": "bierman"}
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
    spec = override(loads(SPECS[name]), "q16.16", filter={"covariance": covariance, "update": FORMS[covariance]})
    found = measure(spec, build(spec).files, simulate(spec, ROWS), target="cortex-m0")
    instructions, flash = CEILINGS[name, covariance]
    assert found.errors == 0
    assert found.step <= instructions
    assert found.flash_linked <= flash
