"""What the C says of the binary point of each local: the value of its raw 1."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from kfgen.generate import build
from kfgen.ir.program import Let, Store, walk
from kfgen.override import override
from kfgen.spec import load

SPECS = Path(__file__).parents[2] / "specs"
FORMS = [{"covariance": "ud", "update": "bierman"}, {"covariance": "full", "update": "standard"}]


@pytest.fixture(scope="module", params=range(len(FORMS)), ids=["ud", "full"])
def cv4(request):
    return build(override(load(SPECS / "cv4.yaml"), "q16.16", filter=FORMS[request.param]))


def test_every_number_has_one(cv4):
    text = cv4.files["cv4.c"]
    text = text[text.index("cv4_status_t cv4_predict") : text.index("cv4_status_t cv4_set_state")]
    declared = re.findall(r"^ +const int(?:32|64)_t \w+ =[^;]*;(.*)$", text, re.M)
    above = len(re.findall(r"^ +/\* 2\^-?\d+ \*/$", text, re.M))
    behind = [note for note in declared if note]
    assert len(declared) > 50
    assert all(re.fullmatch(r" /\* 2\^-?\d+ \*/", note) for note in behind)
    assert len(behind) + above == len(declared)
    assert max(map(len, text.splitlines())) <= 100


def test_states_agree_with_the_header(cv4):
    for name in ("px", "py", "vx", "vy"):
        index = f"CV4_{name.upper()}"
        (lsb,) = re.findall(rf"^#define {index}_LSB (\S+)$", cv4.files["cv4.h"], re.M)
        told = re.findall(rf"const int32_t {name} = kf->x\[{index}\]; /\* 2\^(-?\d+) \*/", cv4.files["cv4.c"])
        assert told
        assert {2.0 ** int(e) for e in told} == {float(lsb)}


def test_what_is_stored_as_it_is_has_the_point_of_its_place(cv4):
    points = {(f"kf.{block.name}", i): e for block in cv4.code.blocks for i, e in enumerate(block.points)}
    met = 0
    for function in cv4.code.functions:
        body = list(walk(function.body))
        locals_ = {s.name: s.point for s in body if isinstance(s, Let)}
        for s in body:
            if isinstance(s, Store) and s.node.op == "variable" and s.index is not None and s.node.data in locals_:
                met += 1
                assert locals_[s.node.data] == points[s.name, int(s.index.constant)]
    assert met > 10
