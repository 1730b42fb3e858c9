"""The report's formulas read as they are written."""

import html
import re

import pytest

from kfgen.report.equations import mathml
from kfgen.spec.expressions import parse


@pytest.mark.parametrize(("written", "read"), [
    ("h/1.2", "h 1.2"),  # a fraction, and no 0.8333
    ("2*0.5*x", "2 ⋅ 0.5 ⋅ x"),
    ("std**2/1e7 + 6378137", "6378137 + std 2 10000000"),
    ("x*1e-10", "10 −10 ⋅ x"),
    ("-2.5e-7*x", "− 2.5 · 10 −7 ⋅ x"),
    ("3e-10**2", "( 3 · 10 −10 ) 2"),
])  # fmt: skip
def test_numbers_stand_as_they_are_written(written: str, read: str) -> None:
    assert " ".join(html.unescape(re.sub("<[^>]+>", " ", mathml(parse(written)))).split()) == read
