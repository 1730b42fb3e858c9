"""The analysis of overflow by frama-c, of one filter; `python -m tests.fixed.eva` does more."""

from __future__ import annotations

import pytest

from tests.fixed.eva import HEAD, analysed, assumed, filters, functions, routines, written


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    folder, spec = tmp_path_factory.mktemp("eva"), next(filters())
    return folder, spec, *written(spec, folder)


def test_no_alarm(ball, needs):
    needs("frama-c")
    folder, spec, header, text, known = ball
    assert analysed(folder, HEAD + routines(text), "ball") == set()
    harness = assumed(known) + HEAD + functions(spec, header, 0)
    assert analysed(folder, harness, "ball", "-eva-use-spec", "ball_q_reciprocal") == set()


def test_an_overflow_is_seen(ball, needs):
    """Where a sum is made before it is known to fit."""
    needs("frama-c")
    folder, _, _, text, _ = ball
    sound = "(uint32_t)a + (uint32_t)b"
    assert sound in text
    (folder / "ball.c").write_text(text.replace(sound, "(uint32_t)(a + b)").replace("NAME", "ball"))
    found = analysed(folder, HEAD + routines(text), "ball")
    assert len(found) == 2
    assert all(alarm.startswith("ball_q_add, line ") and "overflow" in alarm for alarm in found)
