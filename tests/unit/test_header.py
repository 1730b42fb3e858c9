"""What the header of a filter says at its head."""

from __future__ import annotations

import pytest

from kfgen.generate import generate
from kfgen.spec import loads

SPEC = """
kfgen: 1
name: level
dt: 1
{description}states: {{x: {{init: 0, var: 1}}}}
dynamics: {{form: discrete, f: {{x: x}}, Q: {{x: 0.01}}}}
measurements: {{gauge: {{z: {{h: {{h: x, var: 0.1}}}}}}}}
filter: {{type: kf, covariance: full, update: standard}}
"""
FORM = "Kalman filter, full covariance, standard update, float"


@pytest.mark.parametrize(
    ("description", "head"),
    [
        ("", [f" * level: {FORM}", " *", " * state x (1)"]),
        ("description: of a tank\n", [" * level: of a tank", " *", f" * {FORM}", " *", " * state x (1)"]),
    ],
)
def test_the_form_is_told_once(description, head):
    text = generate(loads(SPEC.format(description=description)))["level.h"]
    assert text.splitlines()[2 : 2 + len(head)] == head
    assert text.count(FORM) == 1


def test_a_field_says_where_its_entries_are():
    text = generate(loads(SPEC.format(description="")))["level.h"]
    assert "P[1]; /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */" in text
