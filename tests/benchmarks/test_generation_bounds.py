"""What must not take long to generate: processor seconds, with room for a slow machine."""

from __future__ import annotations

import random
import time

import pytest

from kfgen.advice import advise
from kfgen.generate import build
from kfgen.spec import loads
from tests.oracle import problems


def seconds(text: str) -> float:
    start = time.process_time()
    spec = loads(text)
    advise(spec)
    build(spec)
    return time.process_time() - start


def test_constants_that_use_two_of_the_one_before():
    """Written out, c12 has 3^12 names: each may cost no more than the one above it."""
    lines = [f"  c{i}: sqrt(c{i - 1} + c{i - 1}*sin(c{i - 1}))" for i in range(1, 31)]
    text = "kfgen: 1\nname: nested\nconstants:\n  c0: 1.1\n" + "\n".join(lines) + "\ndt: 0.1\n"
    text += "states: {x: {init: c30, std: c11}}\ndynamics: {f: {x: x*c30/2}, Q: {x: c5}}\n"
    text += "measurements: {m: {z: {x: {h: c3*x, std: c4}}}}\nfilter: {type: kf}\n"
    assert seconds(text) < 5


@pytest.mark.long
def test_long_equations():
    """20 equations of about 1,700 nodes in 20 states."""
    draw = random.Random(1)
    states = [f"s{i}" for i in range(20)]

    def term() -> str:
        a, b, c = (draw.choice(states) for _ in range(3))
        return f"{draw.randint(1, 99)}/100*sin({a}*{b})*{c}"

    f = "".join(f"    {s}: {s} + dt*({' + '.join(term() for _ in range(150))})\n" for s in states)
    text = "kfgen: 1\nname: equations\ndt: 0.01\nstates:\n" + "".join(f"  {s}: {{init: 0.1, std: 1}}\n" for s in states)
    text += f"dynamics:\n  f:\n{f}  Q: {{{', '.join(f'{s}: 1e-4' for s in states)}}}\n"
    text += "measurements: {m: {z: {a: {h: s0, std: 0.1}, b: {h: s7, std: 0.1}}}}\n"
    assert seconds(text) < 40


@pytest.mark.long
def test_many_states():
    assert seconds(problems.chain(64)) < 40


def test_a_thousand_substeps():
    text = "kfgen: 1\nname: fine\ndt: 0.1\nstates: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}\n"
    text += "dynamics: {form: continuous, integrator: euler, substeps: 1000, f: {p: v, v: -sin(p) - 0.1*v},\n"
    text += "  Q: {v: 1e-3}}\n"
    text += "measurements: {m: {z: {x: {h: p, std: 0.1}}}}\n"
    assert seconds(text) < 30
