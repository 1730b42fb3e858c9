"""What holds for every spec in specs/: it builds, agrees with the reference, and documents itself."""

from __future__ import annotations

from pathlib import Path

import pytest

import kfgen
from kfgen.check import compare

SPECS = sorted((Path(__file__).parents[2] / "specs").glob("*.yaml"))


@pytest.fixture(params=SPECS, ids=lambda path: path.stem)
def path(request):
    return request.param


def test_is_named_like_its_file(path):
    assert kfgen.load(path).name == path.stem


def test_agrees_with_the_reference(path):
    spec = kfgen.load(path)
    outcome = compare(kfgen.compile(spec), kfgen.reference(spec), STEPS)
    assert outcome.passed, outcome


STEPS = 80


def test_says_what_it_is(path):
    """A comment at the top, a description for the header, units wherever a number has one."""
    text = path.read_text(encoding="utf-8")
    spec = kfgen.load(path)
    assert text.startswith("# ")
    assert spec.description
    without = [state.name for state in spec.states if not state.unit and state.kind != "quaternion"]
    assert [name for name in without if name != "soc"] == []  # a pure number
    assert all(each.unit for each in spec.inputs)
    assert all(component.unit for sensor in spec.measurements for component in sensor.components)
    assert max(map(len, text.splitlines())) <= 120
