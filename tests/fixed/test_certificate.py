"""`kfgen check` in fixed point: P as coarse as the interface is, and what is known of overflow."""

from __future__ import annotations

import pytest

from kfgen.check import check
from kfgen.fixed.trial.certificate import certify, lines
from kfgen.generate import build
from kfgen.ir.program import roots, walk
from kfgen.spec.loading import loads
from tests.fixed.test_filters import BALL


@pytest.fixture(scope="module")
def generated():
    return build(loads(BALL))


def test_variances_below_the_interface_are_not_held_against_the_filter():
    outcome = check(loads(BALL.replace("200", "50000")), steps=100)
    assert outcome.passed
    assert outcome.x.error < 1e-2
    text = outcome.text()
    assert "proved  guarded  at risk" in text


def test_each_function_is_counted(generated):
    found = {c.function: c for c in generated.fixed.certificates}
    assert set(found) == {f.name for f in generated.code.functions}
    for name in ("predict", "update_pos"):
        assert found[name].run
        assert found[name].proved > 10
        assert found[name].at_risk == 0


def test_what_comes_near_its_limit_is_at_risk(generated):
    update = next(f for f in generated.code.functions if f.name == "update_pos")
    node = next(n for s in walk(update.body) for n in roots(s) if n.op in ("q_mac", "q_fit"))
    calm, near = (certify([update], {id(node): size})[0] for size in (2**29, 2**30 - 1))
    assert (calm.at_risk, near.at_risk) == (0, 1)
    assert calm.guarded == near.guarded + 1
    assert calm.proved == near.proved
    assert lines([near])[1].split() == ["update_pos", str(near.proved), str(near.guarded), "1"]


def test_a_function_that_was_not_run_says_so(generated):
    update = next(f for f in generated.code.functions if f.name == "update_pos")
    assert lines(certify([update], {}))[1].endswith("not run")
