"""What filters of rotations cost on a Cortex-M4F with the flags that their headers recommend, in instructions."""

from __future__ import annotations

from pathlib import Path

import pytest

from kfgen.cost import measure, recommended_flags
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import load

FORMS = {"ud": "bierman", "full": "standard"}

MOST = {
    ("attitude", "ud"): {"predict": 560, "update_mag": 665},
    ("attitude", "full"): {"predict": 450, "update_mag": 545},
    ("gnss_ins", "ud"): {"predict": 3920, "update_mag": 1960, "update_gnss": 2500},
    ("gnss_ins", "full"): {"predict": 2090, "update_mag": 1550, "update_gnss": 1630},
    ("pilot", "ud"): {"predict": 11700},
    ("pilot", "full"): {"predict": 3000},
}


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize(("name", "covariance"), [
    pytest.param(*key, marks=pytest.mark.long) if key[0] == "pilot" else key for key in MOST
])  # fmt: skip
def test_instructions(name, covariance):
    """attitude: 6 errors. gnss_ins: 15. pilot: the 23 of a flight controller."""
    spec = load(Path(__file__).with_name(f"{name}.yaml"))
    spec = override(spec, "float", filter={"covariance": covariance, "update": FORMS[covariance]})
    generated = build(spec)
    found = measure(generated, simulate(spec, 12), flags=recommended_flags(generated.view)).instructions
    over = {f: found[f][0] for f, most in MOST[name, covariance].items() if found[f][0] > most}
    assert not over
