"""`unroll` in fixed point: one form, so that its bits are the same whatever is asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from kfgen.filters.build import build_filter
from kfgen.filters.frame.shared import _Key
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.generate import UNROLLED, build
from kfgen.ir.names import RESERVED
from kfgen.override import override
from kfgen.spec import loads
from kfgen.spec.types import Spec
from tests.oracle import problems

UKF = problems.chain(10).replace("type: ekf", "type: ukf, covariance: full")  # enough states for points in loops
MODELS = {
    **{f"{covariance} {update}": override(loads(problems.chain(4)), filter={"covariance": covariance, "update": update})
       for covariance, update in (("ud", "bierman"), ("ud", "joseph"), ("full", "joseph"), ("full", "standard"),
                                  ("sqrt", None))},
    "kf": loads(problems.CV4), "ukf": loads(UKF), "imm": loads(problems.IMM3),
}  # fmt: skip


def unrolled(spec: Spec, unroll: str) -> Spec:
    return replace(spec, scalar="q16.16", code=replace(spec.code, unroll=unroll))


@pytest.mark.parametrize("name", MODELS)
def test_the_program_is_the_same(name):
    scalar, programs = Fixed("q16.16"), []
    for unroll in ("auto", "none", "full"):
        code = build_filter(unrolled(MODELS[name], unroll), scalar, RESERVED)
        known: dict[int, Any] = {}
        for function in code.functions:
            known[id(function)] = _Key(known).of(function)
        programs.append(list(known.values()))
    assert programs[0] == programs[1] == programs[2]


def test_it_is_told():
    spec = loads(problems.BALL)
    made = {unroll: build(unrolled(spec, unroll)) for unroll in ("auto", "none")}
    assert made["none"].files == made["auto"].files
    assert UNROLLED in made["none"].summary.notes
    assert UNROLLED not in made["auto"].summary.notes
