"""Filters with options: the program, run in Python, against the compiled C, bit for bit.

A failure here is the printer's. The model and the influence functions use only operations that IEEE 754 defines.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from twin import Twin, compiled_call
from variants import readings, spec_with

from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.status import Status

MODEL = """
kfgen: 1
name: bits
scalar: double
dt: 0.125
parameters: {k: 1.5}
states:
  x: {init: 2, var: 0.5}
  y: {init: 1, var: 0.5}
  w: {init: 2, var: 0.25, kind: {periodic: 5}}
covariances: [[x, y, 0.125]]
inputs: {push: {}}
noise: {n: {std: 0.25}}
dynamics:
  form: discrete
  f: {x: x + dt*y, y: y - dt*x/4 + dt*(push + n), w: w + dt*(1 + x*y/16)}
  Q: [[0.01, 0.002, 0], [0.002, 0.01, 0], [0, 0, 0.01]]
measurements:
  fix:
    z:
      a: {h: x}
      b: {h: y + x**2/32}
      c: {h: "x*y/8 + 0.25*s*x"}
    R: [[0.3, 0.1, 0.05], [0.1, 0.2, -0.05], [0.05, -0.05, 0.4]]
    noise: {s: {std: 0.5}}
    partial: true
    gate: {probability: 0.9, reset_after: 1}
  course:
    z: {w: {h: w + x/8, std: 0.1, kind: {periodic: 5}}}
filter: {type: ekf}
"""
# what log_likelihood and tanh would add is the platform's
CODE = "code: {gate_count: true}"
CASES = [
    ("ud-bierman", "robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"),
    ("ud-joseph", "robust: huber, adapt_R: 0.05, consider: [x], gain_limit: 0.4"),
    ("full-joseph", "adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"),
    ("full-joseph", "type: iekf, iterations: 2, gain_limit: 0.3, innovation_floor: 0.5"),
    ("full-standard", "robust: {psi: e/(1 + abs(e)/k)}, innovation_floor: 0.5"),
    ("sqrt", "variance_floor: {x: 0.1}, variance_ceiling: 0.5"),
    ("sqrt", "type: ekf2, robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"),
]


@cache
def calls() -> list[tuple[str, dict[str, Any]]]:
    return list(readings(MODEL, 25, 2))


def follow(twin: Twin) -> Status:
    seen = Status.OK
    for count, (name, arguments) in enumerate(calls()):
        function = name if name == "predict" else f"update_{name}" + ("_masked" if "mask" in arguments else "")
        if count % 7 == 6:  # what has to be refused
            arguments = {k: np.full_like(v, np.nan) if k == "z" else v for k, v in arguments.items()}
        ours, theirs = twin.run(function, **arguments), compiled_call(twin.kf, function, arguments)
        assert ours == theirs, f"call {count}, {function}: program {ours:#x}, C {theirs:#x}"
        assert not twin.differences(), f"call {count}, {function}"
        seen |= Status(theirs)
    return seen


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_c_is_the_program(scalar):
    """Double differs in spelling only."""
    made = []
    for k, (form, options) in enumerate(CASES if scalar == "float" else CASES[::6]):
        spec = replace(spec_with(MODEL, options, form, scalar, CODE), name=f"bits_{k}")
        made.append((spec, build(spec)))
    filters = load_filters([each for _, each in made], flags=["-O0", "-ffp-contract=off"])
    seen = Status.OK
    for (_, each), kf in zip(made, filters, strict=True):
        seen |= follow(Twin(each, kf))
    if scalar == "float":
        flags = Status.GLITCH_SMALL | Status.GLITCH_LARGE | Status.ANOMALY | Status.GATED | Status.REGULARIZED
        assert seen == flags | Status.NOT_FINITE
